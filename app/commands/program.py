"""The command line: what the commands are called and which options they take.

Options arrive as text and are checked in `options`; the work is in the modules that each
command imports when it runs, so that `--help` and small commands start at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from .. import __version__
from ..base.errors import UserError, visible
from ..base.files import allow_outside
from ..model.settings import CAMERA_METHODS, METHODS
from . import completion, options
from .farm import FarmRequest
from .farm_program import SchedulerOption, WorkersOption, add_farm
from .prove_gpu import prove_gpu

if TYPE_CHECKING:
    from rich.text import Text as RichText


class _Interrupted(Exception):
    """Ctrl-C, carried past typer, some of whose versions turn it silently into an exit code."""


class _Program(TyperGroup):
    def invoke(self, ctx: typer.Context) -> object:  # type: ignore[override]
        """Run the command."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as interrupt:
            raise _Interrupted from interrupt


app = typer.Typer(
    name="spectrasplat",
    cls=_Program,
    pretty_exceptions_enable=False,
    no_args_is_help=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

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
        help="Make all solids of a catalogue glass (diamond), or one (OBJECT=N-SF11); may be repeated.",
        autocompletion=completion.glasses,
    ),
]
EnvironmentOption = Annotated[
    str | None,
    typer.Option(
        "--environment", metavar="FILE", help="What lies behind everything: studio, sky, or a panorama's file."
    ),
]
Text = str | None
PIPE_WIDTH = 200
"""Columns where no terminal sets a limit: tables are then not cut."""


def run(arguments: Sequence[str]) -> int:
    """Run one command line; returns the exit code. Raises `UserError` for wrong usage."""
    try:
        code = app(args=list(arguments) or ["--help"], prog_name="spectrasplat", standalone_mode=False)
    except _Interrupted as interrupted:
        raise (interrupted.__cause__ or KeyboardInterrupt()) from None
    except Exception as error:
        # click's usage errors; typer has moved click inside itself, so there is no one class to name.
        if not hasattr(error, "format_message"):
            raise
        raise UserError(_usage_sentence(error.format_message())) from error
    return code if isinstance(code, int) else 0


def _usage_sentence(message: str) -> str:
    sentence = message.strip().rstrip(".").replace(". Did you", ", did you")
    return f"{sentence[:1].lower()}{sentence[1:]}; 'spectrasplat --help' shows the usage"


def _print_version(asked: bool) -> None:
    if asked:
        print(f"spectrasplat {__version__}")
        raise typer.Exit


@app.callback()
def program(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    """Dispersive caustics: light through glass, split into its colours."""


@app.command()
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
    seed: Annotated[Text, typer.Option(metavar="K", help="Seed of the random numbers; default: 1.")] = None,
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
    camera: Annotated[
        Text,
        typer.Option(
            metavar="HOW",
            help="How stills show flat-faceted glass: beams where these should cost less (default with srd), or paths.",
        ),
    ] = None,
    batch: Annotated[
        Text, typer.Option(metavar="N", help="Photons in flight at once (never changes the picture).")
    ] = None,
    stats: Annotated[
        bool, typer.Option("--stats", help="Print the energy balance and the times of all stages.")
    ] = False,
    up: UpOption = None,
    glass: GlassOption = None,
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
        camera,
        batch,
        stats,
        options.parse_opening(up, glass, environment),
        passes,
        glare,
        lens_radius,
        focus_distance,
    )
    raise typer.Exit(render_command(request))


@app.command()
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
    stats: Annotated[
        bool, typer.Option("--stats", help="Print the energy balance and the times of all stages.")
    ] = False,
    allow_outside: AllowOutside = False,
) -> None:
    """Make a picture of its parts, traced one by one or on many machines."""
    from .merge import MergeRequest, merge_command

    raise typer.Exit(merge_command(MergeRequest(tuple(parts), output, scene, exposure, partial, stats)))


@app.command()
def animate(
    scene: SceneArgument,
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            metavar="OUT",
            help="A movie (.mp4), a .gif, or a folder for numbered PNGs, which can be resumed.",
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
    size: Annotated[Text, typer.Option(metavar="WxH", help="Pixels; default: the scene's.")] = None,
    photons: Annotated[
        Text, typer.Option(metavar="N", help="Photons of each traced frame; default: the scene's.")
    ] = None,
    spp: Annotated[Text, typer.Option(metavar="N", help="Camera samples a pixel; default: 16.")] = None,
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
        options.parse_opening(up, glass, environment),
        skip_existing,
    )
    raise typer.Exit(animate_command(request))


@app.command()
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
    size: Annotated[Text, typer.Option(metavar="WxH", help="Pixels; default: the scene's.")] = None,
    photons: Annotated[Text, typer.Option(metavar="N", help="Photons of each tracing; default: the scene's.")] = None,
    spp: Annotated[Text, typer.Option(metavar="N", help="Camera samples a pixel; default: 32.")] = None,
    bins: Annotated[
        Text, typer.Option(metavar="N", help="Keep spectral bins (written to .exr); every point is then traced.")
    ] = None,
    exposure: Annotated[
        Text, typer.Option(metavar="EV", help="Stops brighter (or darker) than is automatic in the first picture.")
    ] = None,
    seed: Annotated[Text, typer.Option(metavar="K", help="Seed of the random numbers; default: 1.")] = None,
    method: MethodOption = None,
    exact: Annotated[
        bool, typer.Option("--exact", help="Trace every point, also where kept photons follow to first order.")
    ] = False,
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace another sweep in the folder.")] = False,
    up: UpOption = None,
    glass: GlassOption = None,
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
        options.parse_opening(up, glass, environment),
    )
    raise typer.Exit(sweep_command(request))


@app.command()
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
    environment: EnvironmentOption = None,
    allow_outside: AllowOutside = False,
) -> None:
    """Open the viewer: edit dispersion and caustics on the screen."""
    from .view import ViewRequest, view_command

    raise typer.Exit(
        view_command(ViewRequest(scene, size, theme, screenshot, after, options.parse_opening(up, glass, environment)))
    )


@app.command()
def lesson(
    name: Annotated[
        Text,
        typer.Argument(metavar="[NAME]", help="Which to open; nothing lists all.", autocompletion=completion.lessons),
    ] = None,
) -> None:
    """Open a lesson in the viewer: a scene, a few sentences, what to try; or list them."""
    from .lesson import lesson_command

    raise typer.Exit(lesson_command(name, _print))


@app.command()
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
    size: Annotated[Text, typer.Option(metavar="WxH", help="Texels; default: 1024x1024.")] = None,
    photons: Annotated[Text, typer.Option(metavar="N", help="Photons to emit; default: the scene's.")] = None,
    seed: Annotated[Text, typer.Option(metavar="K", help="Seed of the random numbers; default: 1.")] = None,
    up: UpOption = None,
    glass: GlassOption = None,
    environment: EnvironmentOption = None,
    allow_outside: AllowOutside = False,
) -> None:
    """Bake the caustic on an object to a texture, with its placement."""
    from .bake import BakeRequest, bake_command

    raise typer.Exit(
        bake_command(
            BakeRequest(scene, receiver, output, size, photons, seed, options.parse_opening(up, glass, environment))
        )
    )


@app.command()
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
    size: Annotated[Text, typer.Option(metavar="WxH", help="Texels; default: 1024x1024.")] = None,
    photons: Annotated[Text, typer.Option(metavar="N", help="Photons to emit; default: the scene's.")] = None,
    seed: Annotated[Text, typer.Option(metavar="K", help="Seed of the random numbers; default: 1.")] = None,
    up: UpOption = None,
    glass: GlassOption = None,
    environment: EnvironmentOption = None,
    allow_outside: AllowOutside = False,
) -> None:
    """Export the caustic on an object to glTF or USD, or as a cookie for game engines."""
    from .export import ExportRequest, export_command

    opening = options.parse_opening(up, glass, environment)
    raise typer.Exit(
        export_command(ExportRequest(scene, receiver, output, size, photons, seed, opening, plane, source))
    )


@app.command()
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

    _print((programs_text if programs else inspect_text)(load_scene(options.find_scene(scene))))


@app.command()
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

    glass_command(query, plot, _print)


@app.command()
def doctor() -> None:
    """Check OpenGL, its limits and the packages, with a remedy for what is missing."""
    from .doctor import examine, report

    checks = examine()
    print(report(checks))
    raise typer.Exit(0 if all(check.usable for check in checks) else 2)


@app.command()
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
        typer.Option("-o", "--output", metavar="DIR", help="Folder for results.json, plots and report.html."),
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
    reference_seconds: Annotated[
        Text,
        typer.Option(
            "--reference-seconds", metavar="S", help="Time added to each scene's cached reference; default: 60."
        ),
    ] = None,
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
    )
    raise typer.Exit(bench_command(request, _print))


@app.command()
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

    raise typer.Exit(stress_command(StressRequest(tuple(scenes or ()), output, cases, list_cases), _print))


@app.command("bench-speed")
def bench_speed() -> None:
    """Measure tracing, splatting, tree building, memory and the warm start on this machine."""
    from ..bench import speed

    for line in speed.run():
        print(line, flush=True)


@app.command("bench-beams")
def bench_beams(
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for beam_costs.json and the plot.")
    ] = Path("bench_beams"),
) -> None:
    """Measure the search for beams by facets and threshold, and what is left to photons."""
    from .bench_beams import bench_beams_command

    raise typer.Exit(bench_beams_command(output))


@app.command("bench-agreement")
def bench_agreement(
    scenes: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[SCENE]...",
            help="Scenes to compare; default: every shipped one that holds glass.",
            autocompletion=completion.scenes,
        ),
    ] = None,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for agreement.json.")] = Path(
        "bench_agreement"
    ),
    photons: Annotated[Text, typer.Option(metavar="N", help="Of each picture; default: 250k.")] = None,
    seeds: Annotated[Text, typer.Option(metavar="N", help="Pictures, at least 2; default: 6.")] = None,
    size: Annotated[Text, typer.Option(metavar="WxH", help="Pixels; default: 240x135.")] = None,
    reference_seconds: Annotated[
        Text,
        typer.Option(
            "--reference-seconds", metavar="S", help="Time added to each scene's cached reference; default: 60."
        ),
    ] = None,
    method: Annotated[
        Text, typer.Option(metavar="NAME", autocompletion=completion.methods, help="Default: srd.")
    ] = None,
    allow_outside: AllowOutside = False,
) -> None:
    """Compare a method's caustics with the float64 reference by standard scores, by pixels and in 8x8 blocks."""
    from .bench_agreement import AgreementRequest, bench_agreement_command

    request = AgreementRequest(tuple(scenes or ()), output, photons, seeds, size, reference_seconds, method)
    raise typer.Exit(bench_agreement_command(request))


@app.command("bench-view")
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


app.command("prove-gpu")(prove_gpu)


def _print(content: object) -> None:
    """Print text as it is, and rich's tables in colour where the terminal has it."""
    if isinstance(content, str):
        print(visible(content))
        return
    from rich.console import Console

    class PlainConsole(Console):
        """Names out of a file are shown as they are: they neither choose colours nor command the terminal."""

        def render_str(self, text: str, **more: Any) -> RichText:
            return super().render_str(visible(text), **more)

    console = PlainConsole(highlight=False, markup=False, emoji=False)
    if not console.is_terminal:
        console.width = PIPE_WIDTH
    console.print(content)


add_farm(app, render, animate, bench, _print)
