"""Commands that measure: their options."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from . import completion
from .arguments import AllowOutside, ReferenceOption, ReferenceSecondsOption, Text
from .printing import show


def bench(
    scenes: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[SCENE]...",
            help="Scenes to measure; default: every shipped one that holds glass.",
            autocompletion=completion.scenes,
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="DIR", help="Folder for results.json, tables.md, plots and report.html."
        ),
    ] = None,
    seconds: Annotated[
        Text,
        typer.Option(
            metavar="S", help="Photon time of each method's and seed's largest rendering; default: 3, with --camera 20."
        ),
    ] = None,
    seeds: Annotated[Text, typer.Option(metavar="N", help="Independent repeats; default: 5.")] = None,
    methods: Annotated[
        Text,
        typer.Option(metavar="A,B", help="Methods to compare; default: all.", autocompletion=completion.method_lists),
    ] = None,
    size: Annotated[Text, typer.Option(metavar="WxH", help="Pixels; default: 480 wide, in the scene's aspect.")] = None,
    reference_seconds: ReferenceSecondsOption = None,
    reference: ReferenceOption = None,
    horizon: Annotated[
        Text,
        typer.Option(
            metavar="S",
            help="Photon time up to which a method is followed that has not come to a relMSE of 1 % by --seconds; "
            "default: ten times --seconds.",
        ),
    ] = None,
    features: Annotated[
        Text,
        typer.Option(
            metavar="SCENE",
            help="Measure instead what each feature of the programs costs in this scene.",
            autocompletion=completion.scenes,
        ),
    ] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Begin anew instead of going on from what DIR holds.")] = False,
    camera_pass: Annotated[
        bool,
        typer.Option(
            "--camera",
            "--eye",
            help="Measure the camera pass, by samples a pixel, instead of the light pass by photons.",
        ),
    ] = False,
    allow_outside: AllowOutside = False,
) -> None:
    """Measure every method's error against its run time, and write a report."""
    from .bench import BenchRequest, bench_command

    request = BenchRequest(
        tuple(scenes or ()),
        output,
        seconds,
        horizon,
        seeds,
        methods,
        size,
        reference_seconds,
        features,
        fresh,
        camera_pass,
        reference,
    )
    raise typer.Exit(bench_command(request, show))


def stress(
    scenes: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[SCENE]...",
            help="Sweep these scenes; default: all stiff cases, and a sweep over shipped scenes.",
            autocompletion=completion.scenes,
        ),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="Folder for stress.json and stress.html.")
    ] = None,
    cases: Annotated[
        Text, typer.Option(metavar="A,B", help="Only these cases; 'prism/' is all of that scene's.")
    ] = None,
    list_cases: Annotated[
        bool, typer.Option("--list", help="List the cases with their number of severities, and measure nothing.")
    ] = False,
    allow_outside: AllowOutside = False,
) -> None:
    """Measure stiff and extreme cases against their promises; exits with 1 where one is broken."""
    from .stress import StressRequest, stress_command

    raise typer.Exit(stress_command(StressRequest(tuple(scenes or ()), output, cases, list_cases), show))


def bench_speed() -> None:
    """Measure tracing, splatting, tree building, memory and the warm start on this machine."""
    from ..bench import speed

    for line in speed.run():
        print(line, flush=True)


def bench_beams(
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for beam_costs.json and the plot.")
    ] = Path("bench_beams"),
) -> None:
    """Measure the search for beams by facets and threshold, and what is left to photons."""
    from .bench_beams import bench_beams_command

    raise typer.Exit(bench_beams_command(output))


def bench_agreement(
    scenes: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[SCENE]...",
            help="Scenes to compare; default: every shipped one that holds glass.",
            autocompletion=completion.scenes,
        ),
    ] = None,
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="DIR", help="Folder for agreement.json and scenes drawn by chance."),
    ] = Path("bench_agreement"),
    photons: Annotated[Text, typer.Option(metavar="N", help="Of each picture; default: 250k.")] = None,
    seeds: Annotated[Text, typer.Option(metavar="N", help="Pictures, at least 2; default: 6.")] = None,
    size: Annotated[Text, typer.Option(metavar="WxH", help="Pixels; default: 240x135.")] = None,
    reference_seconds: ReferenceSecondsOption = None,
    reference: ReferenceOption = None,
    method: Annotated[
        Text, typer.Option(metavar="NAME", autocompletion=completion.methods, help="Default: srd.")
    ] = None,
    random: Annotated[
        Text,
        typer.Option(
            "--random",
            metavar="N",
            help="Compare N scenes drawn by chance instead: glass solids on and over a table; their files are written "
            "to DIR.",
        ),
    ] = None,
    random_seed: Annotated[
        Text, typer.Option(metavar="S", help="Which scenes these are; the same S, the same scenes; default: 1.")
    ] = None,
    random_kinds: Annotated[
        Text,
        typer.Option(
            metavar="plain|all",
            help="What they hold: simple solids of clear glass, or cut stones, vessels, bubbles, tints, ground glass, "
            "gratings, spots and beams as well; default: plain.",
        ),
    ] = None,
    allow_outside: AllowOutside = False,
) -> None:
    """Compare a method's caustics with the float64 reference by standard scores, by pixels and in 8x8 blocks."""
    from .bench_agreement import AgreementRequest, bench_agreement_command

    request = AgreementRequest(
        tuple(scenes or ()),
        output,
        photons,
        seeds,
        size,
        reference_seconds,
        method,
        reference,
        random,
        random_seed,
        random_kinds,
    )
    raise typer.Exit(bench_agreement_command(request))


def bench_view(
    scene: Annotated[
        Text,
        typer.Argument(metavar="[SCENE]", help="Default: the default scene.", autocompletion=completion.scenes),
    ] = None,
    size: Annotated[
        Text, typer.Option(metavar="WxH", help="Of the viewport; default: 960x540, on a GPU 1920x1080.")
    ] = None,
    seconds: Annotated[Text, typer.Option(metavar="S", help="For each phase; default: 6.")] = None,
    allow_outside: AllowOutside = False,
) -> None:
    """Measure the viewer's frame times: accumulating, orbiting, dragging the dispersion."""
    from .bench_view import BenchViewRequest, bench_view_command

    raise typer.Exit(bench_view_command(BenchViewRequest(scene, size, seconds)))
