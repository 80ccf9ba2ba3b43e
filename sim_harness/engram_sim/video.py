"""Chooses parts of a demo and has engram-render draw them, all modes side by side."""

import re
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from engram.inputs import InputError
from engram.paths import relative
from engram_sim.pair import Progress, program, stop
from engram_sim.results import Run

AFTER = 0.6  # s that a clip goes on after its last panel has ended
BEFORE_END = 0.2  # s before the end of a clip that its picture is taken: outcomes are shown
OPENING = 4  # jumps from the start of the run: nothing chosen about them
FRAME_LINE = re.compile(r"frame (\d+)/(\d+)")
TITLES = {"memory": "memory", "line": "straight line", "shift": "shifted plan", "cold": "cold start"}


def choose(runs: list[Run], seconds: float) -> list[tuple[str, int, bool]]:
    """Title, jump number and whether its moving part is meant, for about `seconds` of video.

    The first OPENING jumps as they come, one moving target, then the jumps that tell the modes apart: the first mode succeeds and
    most others fail.
    """
    jumps = [{jump["jump"]: jump for jump in run.finished()} for run in runs]
    common = sorted(set.intersection(*(set(mode) for mode in jumps)))
    moving = [n for n in common if all("move" in mode[n] for mode in jumps)]
    telling = [n for n in common if jumps[0][n]["success"] and not all(mode[n]["success"] for mode in jumps)]
    telling.sort(key=lambda n: (sum(mode[n]["success"] for mode in jumps), n))
    wanted = [(f"jump {n}", n, False) for n in common[:OPENING]]
    wanted += [(f"target moves {n}", n, True) for n in moving[:1]]
    wanted += [(f"jump {n}", n, False) for n in telling if n not in common[:OPENING]]
    chosen, total = [], 0.0
    for title, n, move in wanted:
        total += duration([mode[n] for mode in jumps], move)
        if total > seconds and chosen:
            break
        chosen.append((title, n, move))
    return chosen


def duration(jumps: list[dict], move: bool) -> float:
    """s that a clip of one jump (or of the target's motion after it) lasts over all panels."""
    if move:
        return max(1e-3 * jump["move"]["duration_steps"] for jump in jumps)
    return AFTER + max(jump["t_end_s"] - jump["t_start_s"] for jump in jumps)


def clip_line(runs: list[Run], title: str, n: int, move: bool) -> str:
    """One line of a clips file of engram-render."""
    jumps = [next(jump for jump in run.jumps if jump["jump"] == n) for run in runs]
    fields = [f"{duration(jumps, move):.3f}", title]
    for jump in jumps:
        if move:
            end = jump["t_end_s"] + 1e-3 * jump["move"]["duration_steps"]
            fields += [f"{jump['t_end_s']:.3f}", f"{end:.3f}", ""]
        else:
            outcome = f"ok  {jump['arrival_s']:.2f} s" if jump["success"] else jump["reason"].replace("+", ", ")
            fields += [f"{jump['t_start_s']:.3f}", f"{jump['t_end_s']:.3f}", outcome]
    return ";".join(fields)


def render(runs: list[Run], scene: Path, out: Path, hand: str, seconds: float = 30.0, jobs: int = 2) -> Path | None:
    """Draw about `seconds` of the runs into `out` (mp4) with `jobs` processes.

    Returns its path, or None if nothing could be shown. Raises InputError with the renderer's last message if it fails.
    """
    chosen = choose(runs, seconds)
    if not chosen:
        return None
    draw(runs, [clip_line(runs, *clip) for clip in chosen], scene, out, hand, jobs)
    return out


def draw(runs: list[Run], lines: list[str], scene: Path, out: Path, hand: str, jobs: int = 2, title: str = "") -> None:
    """Draw clips (lines of a clips file of engram-render) of the runs side by side into `out` with `jobs` processes.

    `title` stands for the modes' own.
    """
    jobs = max(1, min(jobs, len(lines)))
    share = -(-len(lines) // jobs)
    parts = [lines[i : i + share] for i in range(0, len(lines), share)]
    frames, total = [0] * len(parts), [0] * len(parts)
    progress = Progress(round(25 * sum(float(line.partition(";")[0]) for line in lines)), "video ")

    def draw_part(k: int) -> Path:
        clips, part = out.with_suffix(f".{k}.txt"), out.with_suffix(f".{k}.mp4")
        clips.write_text("\n".join(parts[k]) + "\n", encoding="utf-8")
        call = [str(program("engram-render")), "--scene", str(scene), "--out", str(part), "--clips", str(clips), "--hand", hand]
        for run in runs:
            call += ["--panel", f"{title or TITLES.get(run.mode, run.mode)}={run.log}"]
        process = subprocess.Popen(call, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, stdin=subprocess.DEVNULL)
        try:
            for line in process.stdout:
                if found := FRAME_LINE.match(line):
                    frames[k], total[k] = int(found[1]), int(found[2])
                    progress.show(min(sum(frames), progress.total - 1))
            said = process.stderr.read().strip()
            if process.wait() != 0:
                raise InputError(f"the video could not be drawn: {said.splitlines()[-1] if said else 'engram-render failed'}")
        finally:
            stop(process)
        clips.unlink()
        return part

    with ThreadPoolExecutor(jobs) as pool:
        pieces = list(pool.map(draw_part, range(len(parts))))
    progress.show(progress.total)
    join(pieces, out)


def join(pieces: list[Path], out: Path) -> None:
    """Put videos of the same kind one after the other into `out`, without encoding them again."""
    if len(pieces) == 1:
        pieces[0].rename(out)
        return
    listing = out.with_suffix(".list")
    listing.write_text("".join(f"file '{piece.name}'\n" for piece in pieces), encoding="utf-8")
    call = ["ffmpeg", "-loglevel", "error", "-y", "-f", "concat", "-safe", "0", "-i", str(listing), "-c", "copy"]
    done = subprocess.run([*call, "-movflags", "+faststart", str(out)], stdin=subprocess.DEVNULL, capture_output=True, text=True)
    if done.returncode != 0:
        raise InputError(f"{relative(out)}: ffmpeg could not join its parts: {done.stderr.strip()}")
    listing.unlink()
    for piece in pieces:
        piece.unlink()


def telling_second(runs: list[Run], seconds: float) -> float:
    """When `render` shows the end of the jump that tells the modes apart best: the first mode succeeds, the fewest others do."""
    ends, start = [], 0.0
    for _, n, move in choose(runs, seconds):
        jumps = [next(jump for jump in run.jumps if jump["jump"] == n) for run in runs]
        start += duration(jumps, move)
        ends.append((move or not jumps[0]["success"], sum(jump["success"] for jump in jumps), start))
    return min(ends)[2] - BEFORE_END


def still(video: Path, out: Path, second: float) -> None:
    """One frame of a video as a picture."""
    call = ["ffmpeg", "-loglevel", "error", "-y", "-ss", f"{second:.2f}", "-i", str(video), "-frames:v", "1", str(out)]
    subprocess.run(call, stdin=subprocess.DEVNULL, check=False)
