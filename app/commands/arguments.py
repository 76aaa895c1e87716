"""Arguments and options that many commands take, with their help and completion."""

from __future__ import annotations

from typing import Annotated

import typer

from ..base.files import allow_outside
from ..model.geometry.mesh_normals import ROUND_DEG
from ..model.settings import CAMERA_METHODS, METHODS
from . import completion

SceneArgument = Annotated[
    str,
    typer.Argument(
        metavar="SCENE",
        help="A scene file (.toml, .glb, .gltf, a bare mesh), or a shipped scene's name.",
        autocompletion=completion.scenes,
    ),
]
MethodOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        help=f"How wavelengths are sampled: {', '.join(METHODS)}; default: srd.",
        autocompletion=completion.methods,
    ),
]
CameraMethodOption = Annotated[
    str | None,
    typer.Option(
        "--camera-method",
        "--eye-method",
        metavar="NAME",
        help=f"The same for the camera's rays: {', '.join(CAMERA_METHODS)}; default: as --method.",
        autocompletion=completion.camera_methods,
    ),
]
AllowOutside = Annotated[
    bool,
    typer.Option(
        "--allow-outside",
        help="Let the scene read files outside its own folder, anywhere this user can; only for scenes you trust.",
        callback=allow_outside,
        expose_value=False,
    ),
]
UpOption = Annotated[
    str | None,
    typer.Option("--up", metavar="AXIS", help="Which axis of a mesh or glTF file is up: y or z; default: guessed."),
]
GlassOption = Annotated[
    list[str] | None,
    typer.Option(
        "--glass",
        metavar="GLASS",
        help="Make all solids of a glass (diamond, 'cobalt blue'), or some: OBJECT=N-SF11, MATERIAL=N-SF11, "
        "'Gem*=diamond', 'Window*=thin N-BK7' (a sheet); may be repeated.",
        autocompletion=completion.glasses,
    ),
]
SmoothOption = Annotated[
    bool | None,
    typer.Option(
        "--smooth/--flat",
        help=f"Round meshes where edges bend by less than {ROUND_DEG:g} degrees, or keep facets flat; default: as the "
        "file's normals say, unless they cannot be meant.",
    ),
]
EnvironmentOption = Annotated[
    str | None,
    typer.Option(
        "--environment", metavar="FILE", help="What lies behind everything: studio, sky, or a panorama's file."
    ),
]
WorkersOption = Annotated[
    str | None,
    typer.Option(
        metavar="N",
        help="Workers on this machine, each with its share of the cores, or a GPU of its own where there are several.",
    ),
]
SchedulerOption = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="A Dask scheduler that runs already, for example tcp://10.0.0.1:8786."),
]
Text = str | None
SeedOption = Annotated[Text, typer.Option(metavar="K", help="Seed of the random numbers; default: 1.")]
StatsOption = Annotated[bool, typer.Option("--stats", help="Print the energy balance and the times of all stages.")]
PixelsOption = Annotated[Text, typer.Option(metavar="WxH", help="Pixels; default: the scene's.")]
TexelsOption = Annotated[Text, typer.Option(metavar="WxH", help="Texels; default: 1024x1024.")]
PhotonsOption = Annotated[Text, typer.Option(metavar="N", help="Photons to emit; default: the scene's.")]
ReferenceOption = Annotated[
    Text,
    typer.Option(
        "--reference",
        metavar="KIND",
        help="What the reference meets: true spheres, lenses, tori and solids of revolution (exact), so that "
        "tessellation counts as an error, or the renderer's triangles (mesh); default: exact.",
    ),
]
ReferenceSecondsOption = Annotated[
    Text,
    typer.Option("--reference-seconds", metavar="S", help="Time added to each scene's cached reference; default: 60."),
]
