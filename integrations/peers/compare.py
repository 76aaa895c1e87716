"""Error against whole-process time, beside renderers that people know.

    python integrations/peers/compare.py prism --peers srd,tracer,mitsuba,luxcore -o peers

Run it with the Python that has SpectraSplat. Renderers from wheels go into an environment of their own in the cache
folder (--venv names another); nothing of the project's changes. What cannot be had is skipped with a sentence. Each
picture is one process, timed from its start to its file; the reference is tracer.cpp, run long with seeds of its own,
in OUT/SCENE/reference_N.bin (kept; more seeds are added by --reference-runs). Writes OUT/results.json (more runs
add to it), OUT/table.md and OUT/SCENE.png: all pictures at one exposure.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import neutral
import numpy as np
import platformdirs
from PIL import Image

HERE = Path(__file__).resolve().parent
WHEELS = {"mitsuba": "mitsuba==3.9.1", "luxcore": "pyluxcore==2.11.2", "cycles": "bpy==5.0.1"}
OURS = ("srd", "srd-lambda")
COMPILE = ["-O3", "-march=native", "-ffast-math", "-fno-finite-math-only", "-fopenmp", "-std=c++17"]
TIMEOUT_S = 200.0
REFERENCE_SAMPLES, REFERENCE_PHOTONS = (
    256,
    {"prism": 200_000_000, "ball": 200_000_000, "brilliant": 150_000_000, "gem": 150_000_000, "goblet": 30_000_000},
)

Rungs = list[tuple[Any, ...]]
LADDERS: dict[str, dict[str, Rungs]] = {
    # photons, camera samples a pixel
    "srd": {"": [(20_000, 4), (100_000, 8), (500_000, 16)]},
    "srd-lambda": {"": [(20_000, 4), (100_000, 8), (500_000, 16)]},
    "tracer": {
        "": [(5_000_000, 8), (20_000_000, 16), (100_000_000, 64)],
        "goblet": [(1_000_000, 8), (4_000_000, 16), (16_000_000, 64)],
    },
    # wavelengths, samples a pixel, and how
    "mitsuba": {
        "": [(12, 16, "ptracer"), (16, 48, "ptracer"), (24, 128, "ptracer")],
        "brilliant": [(12, 16, "ptracer"), (16, 48, "ptracer")],
        "gem": [(12, 16, "ptracer"), (16, 48, "ptracer")],
        "goblet": [(12, 8, "ptracer"), (12, 24, "ptracer"), (16, 48, "ptracer")],
    },
    "luxcore": {"": [(8, 8, "BIDIRCPU"), (12, 24, "BIDIRCPU"), (16, 48, "BIDIRCPU")]},
    "luxcore-own": {"": [(0, 64, "BIDIRCPU"), (0, 256, "BIDIRCPU"), (0, 768, "BIDIRCPU")]},
    "cycles": {
        "": [(4, 16, "mnee"), (6, 32, "mnee"), (8, 64, "mnee")],
        "goblet": [(4, 16, "mnee")],
        "prism": [(4, 16, "mnee")],
        "brilliant": [(4, 16, "mnee")],
        "gem": [(4, 16, "mnee")],
    },
    "pbrt": {"": [(16, 100_000, "sppm"), (64, 200_000, "sppm"), (256, 200_000, "sppm")]},
}


def environment(folder: Path, peers: Sequence[str]) -> tuple[Path, dict[str, str]]:
    """The Python of the peers' environment, made where it is missing, and for each peer that cannot run, why."""
    python, missing = folder / "bin" / "python", {}
    wanted = {"luxcore" if peer == "luxcore-own" else peer for peer in peers} & set(WHEELS)
    if wanted and not python.exists():
        subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)
    for peer in sorted(wanted):
        name = WHEELS[peer].split("==", 1)[0]
        if subprocess.run([str(python), "-c", f"import {name}"], capture_output=True, check=False).returncode == 0:
            continue
        installed = subprocess.run(
            [str(python), "-m", "pip", "install", "-q", WHEELS[peer], "numpy"],
            capture_output=True,
            text=True,
            check=False,
        )
        if installed.returncode:
            missing[peer] = f"{WHEELS[peer]} cannot be installed: {(installed.stderr.strip() or '?').splitlines()[-1]}"
    if not shutil.which("g++"):
        missing["tracer"] = "there is no g++ to compile it."
    if not shutil.which("pbrt"):
        missing["pbrt"] = "there is no pbrt on PATH."
    missing |= {"luxcore-own": missing["luxcore"]} if "luxcore" in missing else {}
    return python, missing


def compiled(folder: Path) -> Path:
    """tracer.cpp's program, compiled where it is older than its source."""
    program, source = folder / "tracer", HERE / "tracer.cpp"
    if not program.exists() or program.stat().st_mtime < source.stat().st_mtime:
        folder.mkdir(parents=True, exist_ok=True)
        subprocess.run(["g++", *COMPILE, str(source), "-o", str(program)], check=True)
    return program


def mitsuba_variant(python: Path, folder: Path) -> str:
    """`llvm_ad_mono` where a small picture of it succeeds (it needs LLVM 17 or later), else `scalar_rgb`."""
    words = [
        str(python),
        "-P",
        str(HERE / "mitsuba_peer.py"),
        str(folder),
        os.devnull,
        "1",
        "1",
        "ptracer",
        "llvm_ad_mono",
    ]
    tried = subprocess.run(words, capture_output=True, check=False, env=peer_environment())
    return "llvm_ad_mono" if tried.returncode == 0 else "scalar_rgb"


def peer_environment() -> dict[str, str]:
    """The variables of a peer's process: it finds neutral.py, and nothing of the project's environment."""
    return {key: value for key, value in os.environ.items() if key != "VIRTUAL_ENV"} | {"PYTHONPATH": str(HERE)}


def command(
    peer: str, scene: str, rung: tuple[Any, ...], folder: Path, out: Path, python: Path, program: Path
) -> list[str]:
    """The words of one process that makes one picture."""
    if peer in OURS:
        words = [
            sys.executable,
            "-P",
            "-m",
            "spectrasplat",
            "render",
            str(HERE / "scenes" / f"{scene}.toml"),
            "-o",
            str(out),
        ]
        return [*words, "--method", peer, "--photons", str(rung[0]), "--spp", str(rung[1])]
    if peer == "tracer":
        return [str(program), str(folder / "scene.bin"), str(out.with_suffix(".bin")), *map(str, rung), "1"]
    script = HERE / f"{peer.removesuffix('-own')}_peer.py"
    return [
        str(python if peer != "pbrt" else sys.executable),
        "-P",
        str(script),
        str(folder),
        str(out),
        *map(str, rung),
    ]


def read(path: Path) -> np.ndarray:
    """X, Y, Z and the receiver's share, float64 (height, width, 4), of one of tracer.cpp's files (square pictures)."""
    values = np.fromfile(path, dtype="<f4").astype(float)
    side = round((len(values) / 4) ** 0.5)
    return values.reshape(side, side, 4)


def reference(scene: str, folder: Path, program: Path, runs: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean X, Y, Z of the long runs, that mean's variance, and where the receiver is seen, a pixel off all else."""
    for number in range(1, runs + 1):
        out = folder / f"reference_{number}.bin"
        if not out.exists():
            counts = [str(REFERENCE_PHOTONS[scene]), str(REFERENCE_SAMPLES), str(1000 + number)]
            subprocess.run([str(program), str(folder / "scene.bin"), str(out), *counts], check=True)
    pictures = np.array([read(path) for path in sorted(folder.glob("reference_*.bin"))])
    shown = np.pad(pictures[0, ..., 3] == 1, 1, constant_values=False)
    side = len(shown) - 2
    mask = np.all([shown[i : i + side, j : j + side] for i in range(3) for j in range(3)], axis=0)
    return pictures[..., :3].mean(axis=0), pictures[..., :3].var(axis=0, ddof=1) / len(pictures), mask


def errors(picture: np.ndarray, truth: np.ndarray, variance: np.ndarray, mask: np.ndarray) -> dict[str, float]:
    """nRMSE and relMSE of X, Y, Z over `mask`, less the reference's own variance, and mean Y over the reference's."""
    square, r2 = (picture - truth)[mask] ** 2 - variance[mask], truth[mask] ** 2
    floor = 0.01 * truth[mask][truth[mask] > 0].mean() ** 2
    return {
        "nrmse": float(np.sqrt(max(square.mean(), 0.0) / r2.mean())),
        "relmse": float(max((square / (r2 + floor)).mean(), 0.0)),
        "light": float(picture[mask][:, 1].sum() / truth[mask][:, 1].sum()),
    }


def measured(words: list[str], ours: bool) -> tuple[float, float, str]:
    """Wall and processor seconds of a process, and what went wrong ("" for nothing)."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    try:
        done = subprocess.run(
            words,
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S,
            check=False,
            env=None if ours else peer_environment(),
        )
        fault = "" if done.returncode == 0 else (done.stderr.strip() or "no word").splitlines()[-1][:200]
    except subprocess.TimeoutExpired:
        fault = f"not done after {TIMEOUT_S:.0f} s"
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, fault


def picture_of(path: Path, ours: bool) -> np.ndarray:
    """X, Y, Z float64 (height, width, 3) of a finished process."""
    if not path.exists():
        return read(path.with_suffix(".bin"))[..., :3]
    from spectrasplat.model.optics.colorimetry import rgb709_to_xyz

    values = np.load(path).astype(float)
    return np.asarray(rgb709_to_xyz(values)) if ours else values


def shown(xyz: np.ndarray, scale: float) -> np.ndarray:
    """uint8 sRGB; what is outside is clipped."""
    from spectrasplat.model.optics.colorimetry import xyz_to_rgb709

    rgb = np.clip(np.asarray(xyz_to_rgb709(xyz)) * scale, 0.0, 1.0)
    return np.asarray(
        255 * np.where(rgb < 0.0031308, 12.92 * rgb, 1.055 * rgb ** (1 / 2.4) - 0.055) + 0.5, dtype=np.uint8
    )


def strip(scene: str, out: Path, rows: list[dict[str, Any]], truth: np.ndarray) -> None:
    """The reference and each peer's longest picture at one exposure, side by side."""
    scale = 0.9 / np.percentile(truth[..., 1][truth[..., 1] > 0.001 * truth[..., 1].max()], 90)
    done = {row["peer"]: row for row in rows if row["scene"] == scene and row.get("file")}
    last = {peer: done[peer] for peer in LADDERS if peer in done}
    pictures = [truth, *(picture_of(out / row["file"], row["peer"] in OURS) for row in last.values())]
    Image.fromarray(np.concatenate([shown(picture, scale) for picture in pictures], axis=1)).save(out / f"{scene}.png")
    print(f"{out / scene}.png: reference, {', '.join(last)}")


def sooner(ours: list[dict[str, Any]], theirs: list[dict[str, Any]], metric: str) -> str:
    """How many times sooner the first has the error that the second ends with, along its curve; "–" where the
    second lacks a tenth of the light."""
    end = theirs[-1]
    if end["light"] < 0.9:
        return "–"
    curve = sorted((row["seconds"], row[metric]) for row in ours)
    seconds, values = np.log([s for s, _ in curve]), np.log([max(v, 1e-12) for _, v in curve])
    goal = np.log(max(end[metric], 1e-12))
    values = np.minimum.accumulate(values)
    if values[-1] > goal:
        return f"< {end['seconds'] / np.exp(seconds[-1]):.2g}"
    if values[0] <= goal:
        return f"≥ {end['seconds'] / np.exp(seconds[0]):.2g}"
    return f"{end['seconds'] / np.exp(np.interp(-goal, -values, seconds)):.2g}"


def table(results: list[dict[str, Any]]) -> str:
    """Markdown: a row a peer and scene, a cell a budget, and how many times sooner `srd` has the peer's last error."""
    lines = [
        "| scene | renderer | seconds: nRMSE, relMSE | light | `srd` sooner: nRMSE, relMSE |",
        "| --- | --- | --- | --- | --- |",
    ]
    done = [row for row in results if "nrmse" in row]
    for scene in neutral.SCENES:
        mine = [row for row in done if (row["scene"], row["peer"]) == (scene, "srd")]
        for peer in LADDERS:
            rows = sorted((r for r in done if (r["scene"], r["peer"]) == (scene, peer)), key=lambda r: r["rung"])
            if rows:
                cells = "; ".join(f"{r['seconds']:.1f}: {r['nrmse']:.3g}, {r['relmse']:.2g}" for r in rows)
                ratio = ", ".join(sooner(mine, rows, m) for m in ("nrmse", "relmse")) if mine and peer != "srd" else ""
                lines.append(f"| `{scene}` | `{peer}` | {cells} | {rows[-1]['light']:.3f} | {ratio} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measures what the command line names."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=list(neutral.SCENES))
    parser.add_argument("--peers", default=",".join(LADDERS), help="rows, with commas between")
    parser.add_argument("--rungs", default="0,1,2", help="which of each row's budgets")
    parser.add_argument("--reference-runs", type=int, default=4)
    parser.add_argument("--venv", type=Path, default=Path(platformdirs.user_cache_dir("spectrasplat-peers")) / "venv")
    parser.add_argument("-o", "--out", type=Path, default=Path("peers"))
    words = parser.parse_args()
    peers = words.peers.split(",")
    python, missing = environment(words.venv, peers)
    for peer in (peer for peer in peers if peer in missing):
        print(f"{peer} is skipped: {missing[peer]}")
    if "tracer" in missing:
        raise SystemExit("The reference needs g++.")
    program, store = compiled(words.out), words.out / "results.json"
    results: list[dict[str, Any]] = json.loads(store.read_text(encoding="utf-8")) if store.exists() else []
    for scene in words.scenes:
        folder = words.out / scene
        neutral.export(scene, folder)
        truth, variance, mask = reference(scene, folder, program, words.reference_runs)
        own = np.sqrt(variance[mask].mean() / (truth[mask] ** 2).mean())
        floor = 0.01 * truth[mask][truth[mask] > 0].mean() ** 2
        relative = (variance[mask] / (truth[mask] ** 2 + floor)).mean()
        print(f"{scene}: reference's own nRMSE {own:.2g}, relMSE {relative:.2g}")
        for peer in (peer for peer in peers if peer not in missing):
            variant = (mitsuba_variant(python, folder),) if peer == "mitsuba" else ()
            for number in map(int, words.rungs.split(",")):
                ladder = LADDERS[peer].get(scene, LADDERS[peer][""])
                if number >= len(ladder):
                    continue
                rung = ladder[number] + variant
                out = folder / f"{peer}_{number}.npy"
                seconds, processor, fault = measured(
                    command(peer, scene, rung, folder, out, python, program), peer in OURS
                )
                row: dict[str, Any] = {
                    "scene": scene,
                    "peer": peer,
                    "rung": number,
                    "settings": rung,
                    "seconds": seconds,
                    "processor": processor,
                }
                row |= {"fault": fault} if fault else {"file": str(out.relative_to(words.out))}
                row |= {} if fault else errors(picture_of(out, peer in OURS), truth, variance, mask)
                results = [r for r in results if (r["scene"], r["peer"], r["rung"]) != (scene, peer, number)] + [row]
                store.write_text(json.dumps(results, indent=1), encoding="utf-8")
                print({key: round(value, 4) if isinstance(value, float) else value for key, value in row.items()})
        strip(scene, words.out, results, truth)
    (words.out / "table.md").write_text(table(results), encoding="utf-8")


if __name__ == "__main__":
    main()
