"""The bench-beams command: makes a context, prints searches as they are measured, writes table and plot."""

from __future__ import annotations

from pathlib import Path

from ..base.atomic import atomic_output, make_output_folder


def bench_beams_command(output: Path) -> int:
    """Measure and print; returns the exit code. Raises `UserError`."""
    import msgspec

    from ..bench import beam_costs
    from ..gpu.context import create_context

    make_output_folder(output, "beam_costs.json")
    costs = []
    print(beam_costs.HEAD, flush=True)
    with create_context() as context:
        for cost in beam_costs.measure(context):
            costs.append(cost)
            print(beam_costs.line(cost), flush=True)
            # Whoever stops it keeps what is measured.
            with atomic_output(output / "beam_costs.json") as temporary:
                temporary.write_bytes(msgspec.json.format(msgspec.json.encode(costs)))
    beam_costs.plot(costs, output / "beam_costs")
    print(f"wrote {output / 'beam_costs.json'} and beam_costs.png, .svg beside it")
    return 0
