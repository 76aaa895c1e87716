"""The bench-beams command: makes a context, prints searches as they are measured, writes table and plot."""

from __future__ import annotations

from pathlib import Path

from ..base.atomic import atomic_output, check_writable
from ..base.errors import UserError


def bench_beams_command(output: Path) -> int:
    """Measure and print; returns the exit code. Raises `UserError`."""
    import msgspec

    from ..bench import beam_costs
    from ..gpu.context import create_context

    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(
            f"cannot make the folder {output}: {error.strerror or error}; give another one with -o"
        ) from error
    check_writable(output / "beam_costs.json")
    costs = []
    print(beam_costs.HEAD, flush=True)
    with create_context() as context:
        for cost in beam_costs.measure(context):
            costs.append(cost)
            print(beam_costs.lines(cost), flush=True)
            # Whoever stops it keeps what is measured.
            with atomic_output(output / "beam_costs.json") as temporary:
                temporary.write_bytes(msgspec.json.format(msgspec.json.encode(costs)))
    beam_costs.plot(costs, output / "beam_costs")
    print(f"wrote {output / 'beam_costs.json'} and beam_costs.png, .svg beside it")
    return 0
