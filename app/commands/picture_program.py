"""Commands that make pictures: their options."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from . import completion, options
from .arguments import (
    AllowOutside,
    CameraMethodOption,
    EnvironmentOption,
    GlassOption,
    MethodOption,
    PixelsOption,
    SceneArgument,
    SchedulerOption,
    SeedOption,
    SmoothOption,
    StatsOption,
    Text,
    UpOption,
    WorkersOption,
)
from .farm import FarmRequest


def render(
    scene: SceneArgument,
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            metavar="OUT",
            help="The picture: .png, .jpg, .webp (to look at), .exr or .npy (linear, to work on).",
        ),
    ],
    size: Annotated[
        Text, typer.Option(metavar="WxH", help="Pixels, for example 1920x1080; default: the scene's.")
    ] = None,
    photons: Annotated[
        Text, typer.Option(metavar="N", help="Photons to emit, for example 4M; default: the scene's.")
    ] = None,
    seconds: Annotated[
        Text, typer.Option(metavar="S", help="Seconds that the picture may take in all, instead.")
    ] = None,
    seed: SeedOption = None,
    method: MethodOption = None,
    camera_method: CameraMethodOption = None,
    layer: Annotated[
        Text,
        typer.Option(
            metavar="LAYER", help="beauty (default), caustic, or map:RECEIVER.", autocompletion=completion.layers
        ),
    ] = None,
    bins: Annotated[
        Text,
        typer.Option(
            metavar="N", help=f"Keep {options.MIN_BINS} to {options.MAX_BINS} spectral bins (written to .exr)."
        ),
    ] = None,
    exposure: Annotated[
        Text, typer.Option(metavar="EV", help="Stops brighter (or darker) than automatic; not of .exr and .npy.")
    ] = None,
    glare: Annotated[
        Text,
        typer.Option(
            metavar="SHARE", help="Share of the light that the lens scatters, 0 to 0.5; not of .exr and .npy."
        ),
    ] = None,
    lens_radius: Annotated[
        Text,
        typer.Option(
            "--lens-radius",
            metavar="R",
            help="Half the aperture of the camera's lens, scene units: what is out of focus is blurred.",
        ),
    ] = None,
    focus_distance: Annotated[
        Text,
        typer.Option(
            "--focus-distance", metavar="D", help="From the lens to what is in focus; default: the camera's target."
        ),
    ] = None,
    max_depth: Annotated[
        Text, typer.Option("--max-depth", metavar="N", help="Specular events on a light path, at most; default: 64.")
    ] = None,
    spp: Annotated[Text, typer.Option(metavar="N", help="Camera samples a pixel.")] = None,
    batch: Annotated[
        Text, typer.Option(metavar="N", help="Photons in flight at once (never changes the picture).")
    ] = None,
    polarisation: Annotated[
        bool | None,
        typer.Option(
            "--polarisation/--no-polarisation",
            help="Light keeps its polarisation from surface to surface (default: as the scene has it).",
        ),
    ] = None,
    antialias_highlights: Annotated[
        bool | None,
        typer.Option(
            "--antialias-highlights/--no-antialias-highlights",
            help="Edges of what is overexposed without steps (default: as the scene has it; not of .exr and .npy).",
        ),
    ] = None,
    bounces: Annotated[
        Text,
        typer.Option(
            metavar="N",
            help=f"How often light goes on from one diffuse surface to another, 0 to {options.MAX_BOUNCES} "
            "(default: as the scene has it).",
        ),
    ] = None,
    haze: Annotated[
        Text,
        typer.Option(
            metavar="K",
            help="Haze in which light is seen on its way: what is scattered per scene unit, for example 0.03 "
            "(default: as the scene has it).",
        ),
    ] = None,
    haze_anisotropy: Annotated[
        Text,
        typer.Option(
            metavar="G",
            help="Mean cosine of the angle by which haze scatters, -0.99 to 0.99 (default: as the scene has it).",
        ),
    ] = None,
    stats: StatsOption = False,
    up: UpOption = None,
    glass: GlassOption = None,
    smooth: SmoothOption = None,
    environment: EnvironmentOption = None,
    passes: Annotated[
        Text,
        typer.Option(
            metavar="I/N", help="Trace only part I of N, to a file OUT.ssp: 'merge' makes the picture of all parts."
        ),
    ] = None,
    allow_outside: AllowOutside = False,
) -> None:
    """Render a scene to a picture file."""
    from .render import RenderRequest, render_command

    request = RenderRequest(
        scene,
        output,
        size,
        photons,
        seconds,
        seed,
        method,
        camera_method,
        layer,
        bins,
        exposure,
        max_depth,
        spp,
        batch,
        stats,
        options.parse_opening(up, glass, environment, smooth),
        passes,
        glare,
        lens_radius,
        focus_distance,
        polarisation,
        antialias_highlights,
        bounces,
        haze,
        haze_anisotropy,
    )
    raise typer.Exit(render_command(request))


def merge(
    parts: Annotated[
        list[Path],
        typer.Argument(metavar="PART.ssp...", help="Parts that 'render --passes' wrote, or folders of them."),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            metavar="OUT",
            help="The picture: .png, .exr or .npy; or .ssp, a part that holds them all.",
        ),
    ],
    scene: Annotated[
        Text, typer.Option(metavar="SCENE", help="The scene; default: the file that the parts were traced from.")
    ] = None,
    exposure: Annotated[
        Text, typer.Option(metavar="EV", help="Stops brighter (or darker) than automatic; .png only.")
    ] = None,
    partial: Annotated[
        bool, typer.Option("--partial", help="Make a noisier picture of the parts there are, where some are missing.")
    ] = False,
    stats: StatsOption = False,
    allow_outside: AllowOutside = False,
) -> None:
    """Make a picture of its parts, traced one by one or on many machines."""
    from .merge import MergeRequest, merge_command

    raise typer.Exit(merge_command(MergeRequest(tuple(parts), output, scene, exposure, partial, stats)))


def animate(
    scene: SceneArgument,
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            metavar="OUT",
            help="A movie (.mp4, .gif or .webp), or a folder for numbered PNGs, which can be resumed.",
        ),
    ],
    turntable: Annotated[
        bool,
        typer.Option(
            "--turntable", help="Turn the camera once about its target; what happens when nothing else is asked for."
        ),
    ] = False,
    keys: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.toml",
            help="Keys of any parameter: tables named keys with time_s, parameter, value, interpolation.",
        ),
    ] = None,
    ranges: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="P=A:B",
            help="Let a parameter go from A to B, for example objects.prism.dispersion_gain=0:3; may be repeated.",
        ),
    ] = None,
    frames: Annotated[
        Text,
        typer.Option(
            metavar="N",
            help="Pictures in all; default: 120, or as many as the keys last. Or some of them by the numbers of their "
            "files: 101-200, or 101-200/240 of 240 in all.",
        ),
    ] = None,
    fps: Annotated[Text, typer.Option(metavar="F", help="Pictures a second; default: 24.")] = None,
    size: PixelsOption = None,
    photons: Annotated[
        Text, typer.Option(metavar="N", help="Photons of each traced frame; default: the scene's.")
    ] = None,
    spp: Annotated[
        Text, typer.Option(metavar="N", help="Camera samples a pixel; default: 16, with --layer caustic 64.")
    ] = None,
    exposure: Annotated[
        Text, typer.Option(metavar="EV", help="Stops brighter (or darker) than is automatic in the first frame.")
    ] = None,
    seed: Annotated[
        Text, typer.Option(metavar="K", help="Seed of the random numbers, the same for all frames; default: 1.")
    ] = None,
    method: MethodOption = None,
    camera_method: CameraMethodOption = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace the frames of another animation in the folder.")
    ] = False,
    up: UpOption = None,
    glass: GlassOption = None,
    smooth: SmoothOption = None,
    environment: EnvironmentOption = None,
    skip_existing: Annotated[
        bool,
        typer.Option(
            "--skip-existing",
            help="Make only frames that are neither in the folder nor being made by another process; what happens "
            "anyway, for those who like to say it.",
        ),
    ] = False,
    allow_outside: AllowOutside = False,
) -> None:
    """Render an animation: a turntable, or any parameters over time."""
    from .animate import AnimateRequest, animate_command

    request = AnimateRequest(
        scene,
        output,
        turntable,
        keys,
        tuple(ranges or ()),
        frames,
        fps,
        size,
        photons,
        spp,
        exposure,
        seed,
        method,
        camera_method,
        overwrite,
        options.parse_opening(up, glass, environment, smooth),
        skip_existing,
    )
    raise typer.Exit(animate_command(request))


def sweep(
    scene: SceneArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="A folder for pictures and sweep.json, their values.")
    ],
    ranges: Annotated[
        list[str],
        typer.Option(
            "--set",
            metavar="P=A:B:N",
            help="A parameter's values: N from A to B, or a list A,B,C; may be repeated for all combinations.",
        ),
    ],
    picture_format: Annotated[
        Text, typer.Option("--format", metavar="NAME", help="png (default), jpg, webp, exr or npy.")
    ] = None,
    size: PixelsOption = None,
    photons: Annotated[Text, typer.Option(metavar="N", help="Photons of each tracing; default: the scene's.")] = None,
    spp: Annotated[Text, typer.Option(metavar="N", help="Camera samples a pixel; default: 32.")] = None,
    bins: Annotated[
        Text, typer.Option(metavar="N", help="Keep spectral bins (written to .exr); every point is then traced.")
    ] = None,
    exposure: Annotated[
        Text, typer.Option(metavar="EV", help="Stops brighter (or darker) than is automatic in the first picture.")
    ] = None,
    seed: SeedOption = None,
    method: MethodOption = None,
    exact: Annotated[
        bool, typer.Option("--exact", help="Trace every point, also where kept photons follow to first order.")
    ] = False,
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace another sweep in the folder.")] = False,
    up: UpOption = None,
    glass: GlassOption = None,
    smooth: SmoothOption = None,
    environment: EnvironmentOption = None,
    allow_outside: AllowOutside = False,
) -> None:
    """Render a picture for every combination of parameters' values."""
    from .sweep import SweepRequest, sweep_command

    request = SweepRequest(
        scene,
        output,
        tuple(ranges),
        picture_format,
        size,
        photons,
        spp,
        bins,
        exposure,
        seed,
        method,
        exact,
        overwrite,
        FarmRequest(workers, scheduler),
        options.parse_opening(up, glass, environment, smooth),
    )
    raise typer.Exit(sweep_command(request))
