"""Commands about one scene, its caustics and glasses, and about this machine: their options."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from . import completion, options
from .arguments import (
    AllowOutside,
    EnvironmentOption,
    GlassOption,
    PhotonsOption,
    SceneArgument,
    SeedOption,
    SmoothOption,
    TexelsOption,
    Text,
    UpOption,
)
from .printing import show


def view(
    scene: Annotated[
        Text,
        typer.Argument(
            metavar="[SCENE]",
            help="A scene file, a bare mesh, or a shipped scene's name; default: the default scene.",
            autocompletion=completion.scenes,
        ),
    ] = None,
    size: Annotated[Text, typer.Option(metavar="WxH", help="Of the window; default: as it was last.")] = None,
    theme: Annotated[Text, typer.Option(metavar="NAME", help="dark or light; default: as it was last.")] = None,
    screenshot: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Write a picture of the window and close.")
    ] = None,
    after: Annotated[
        Text, typer.Option(metavar="S", help="Seconds from the first picture until --screenshot; default: 10.")
    ] = None,
    up: UpOption = None,
    glass: GlassOption = None,
    smooth: SmoothOption = None,
    environment: EnvironmentOption = None,
    allow_outside: AllowOutside = False,
) -> None:
    """Open the viewer: edit dispersion and caustics on the screen."""
    from .view import ViewRequest, view_command

    raise typer.Exit(
        view_command(
            ViewRequest(scene, size, theme, screenshot, after, options.parse_opening(up, glass, environment, smooth))
        )
    )


def lesson(
    name: Annotated[
        Text,
        typer.Argument(metavar="[NAME]", help="Which to open; nothing lists all.", autocompletion=completion.lessons),
    ] = None,
) -> None:
    """Open a lesson in the viewer: a scene, a few sentences, what to try; or list them."""
    from .lesson import lesson_command

    raise typer.Exit(lesson_command(name, show))


def bake(
    scene: SceneArgument,
    receiver: Annotated[
        str,
        typer.Argument(
            metavar="RECEIVER", help="The diffuse object whose caustic is baked.", autocompletion=completion.receivers
        ),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            metavar="OUT",
            help="The texture: .exr or .npy (linear irradiance), .png (to look at); where it lies is written to a "
            ".json beside it.",
        ),
    ],
    size: TexelsOption = None,
    photons: PhotonsOption = None,
    seed: SeedOption = None,
    up: UpOption = None,
    glass: GlassOption = None,
    smooth: SmoothOption = None,
    environment: EnvironmentOption = None,
    allow_outside: AllowOutside = False,
) -> None:
    """Bake the caustic on an object to a texture, with its placement."""
    from .bake import BakeRequest, bake_command

    raise typer.Exit(
        bake_command(
            BakeRequest(
                scene, receiver, output, size, photons, seed, options.parse_opening(up, glass, environment, smooth)
            )
        )
    )


def export(
    scene: SceneArgument,
    receiver: Annotated[
        str,
        typer.Argument(
            metavar="RECEIVER",
            help="The diffuse object whose caustic is exported.",
            autocompletion=completion.receivers,
        ),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            metavar="OUT",
            help="The receiver with its caustic as emission: .glb, .gltf, .usda, .usdc, .usd; or a spot light's "
            "cookie: .png, .exr. Numbers are written to a .json beside it.",
        ),
    ],
    plane: Annotated[
        bool, typer.Option("--plane", help="Only the rectangle that is lit, as bright as on a white receiver.")
    ] = False,
    source: Annotated[
        Text,
        typer.Option(
            "--source",
            metavar="X,Y,Z",
            help="Where the cookie's spot stands; default: at the scene's only lamp, or straight above.",
        ),
    ] = None,
    size: TexelsOption = None,
    photons: PhotonsOption = None,
    seed: SeedOption = None,
    up: UpOption = None,
    glass: GlassOption = None,
    smooth: SmoothOption = None,
    environment: EnvironmentOption = None,
    allow_outside: AllowOutside = False,
) -> None:
    """Export the caustic on an object to glTF or USD, or as a cookie for game engines."""
    from .export import ExportRequest, export_command

    opening = options.parse_opening(up, glass, environment, smooth)
    raise typer.Exit(
        export_command(ExportRequest(scene, receiver, output, size, photons, seed, opening, plane, source))
    )


def inspect(
    scene: SceneArgument,
    programs: Annotated[
        bool,
        typer.Option("--programs", help="List instead what each of its programs asks of the driver; compiles them."),
    ] = False,
    allow_outside: AllowOutside = False,
) -> None:
    """Show what a scene holds, its glasses and mesh health, and which features its programs need."""
    from ..model.io.scene_file import load_scene
    from .inspect_programs import programs_text
    from .inspect_report import inspect_text

    show((programs_text if programs else inspect_text)(load_scene(options.find_scene(scene))))


def glass(
    query: Annotated[
        Text,
        typer.Argument(
            metavar="[QUERY]", help="Part of a name or maker; nothing lists all.", autocompletion=completion.glasses
        ),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FILE.png", help="Plot n over the wavelength and the place in the Abbe diagram."),
    ] = None,
) -> None:
    """Search the glass catalogue; show one glass in full."""
    from .glass import glass_command

    glass_command(query, plot, show)


def doctor() -> None:
    """Check OpenGL, its limits and the packages, with a remedy for what is missing."""
    from .doctor import examine, report

    checks = examine()
    print(report(checks))
    raise typer.Exit(0 if all(check.usable for check in checks) else 2)
