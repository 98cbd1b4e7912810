"""The circle that jumps from the left to the right, with and without GSA: the paper's figure on augmentation."""

from collections.abc import Sequence
from statistics import fmean
from typing import Final

from gsvc_lab.experiments.experiment import Experiment, Result, Run, Table, Verdict
from gsvc_lab.experiments.figures import line, log_axis, new_figure, save_figure, show_centers, show_picture
from gsvc_lab.experiments.fitting import pruned_to
from gsvc_lab.experiments.jumping import CASES, SCENE, WAYS, Jump, Outcome, Size, measure
from gsvc_ref.encoder.settings import PaperSettings

EMPTY, CAPTURED = 0.1, 0.9
"""A frame counts as empty with less of the circle's pixels in its colour, and the circle as captured with more."""

SMALL: Final = Size(128, 72, 200, 4000, (100, 300, 1000, 3000), (0, 1, 2))
FULL: Final = Size(640, 360, 5000, 50_000, (1000, 5000, 50_000), (0, 1, 2))


def chosen(found: Sequence[Outcome], case: str, way: str, iterations: int | None = None) -> list[Outcome]:
    """The outcomes of a case and a way, at the most iterations if not said otherwise."""
    some = [one for one in found if one.case == case and one.way == way]
    iterations = max(one.iterations for one in some) if iterations is None else iterations
    return [one for one in some if one.iterations == iterations]


def verdict(found: Sequence[Outcome]) -> Verdict:
    """Whether frames stay empty without GSA, and the circle is captured with it, at the most iterations."""
    holds, parts = {}, []
    for case, about in CASES.items():
        without, with_it = ([one.coverage for one in chosen(found, case, way)] for way in WAYS)
        holds[case] = (max(without) < EMPTY, min(with_it) > CAPTURED)
        quality = [fmean([one.psnr for one in chosen(found, case, way)]) for way in WAYS]
        parts.append(
            f"{about}: without GSA {100 * fmean(without):.0f} % of the circle and {quality[0]:.1f} dB, with GSA "
            f"{100 * fmean(with_it):.0f} % and {quality[1]:.1f} dB"
        )
    numbers = f"after {max(one.iterations for one in found):,} iterations, means over random starts; {'; '.join(parts)}"
    usual = [holds["light"], holds["black"]]
    if all(empty and captured for empty, captured in usual):
        return Verdict("yes", f"Without GSA the frame stays empty, and with it the circle is captured: {numbers}.")
    if any(empty for empty, _ in usual):
        where = " and ".join(CASES[case] for case in ("light", "black") if holds[case][0])
        caught = "captures the circle" if all(captured for _, captured in usual) else "does not always capture it"
        return Verdict("partly", f"Without GSA the frame stays empty on {where}, and GSA {caught}: {numbers}.")
    why = "the I-frame's splats lie all over the frame, those outside of the circle too, and are coloured again"
    if holds["gone"][0]:
        caught = "captures the circle" if holds["gone"][1] else "captures a part of the circle"
        return Verdict(
            "partly",
            f"Trained as the paper says, the frame does not come out empty without GSA: {why}. Only where no splat is "
            f"left at the new place does it stay empty, and GSA then {caught}: {numbers}.",
        )
    return Verdict("no", f"No frame stays empty without GSA: {why}: {numbers}.")


def draw(size: Size, found: Sequence[Outcome], run: Run) -> dict[str, str]:
    """The figures, with captions."""
    figure, axes = new_figure(9, 4.2, 3, 5)
    for row, case in enumerate(CASES):
        jump = Jump(size.width, size.height, run.threads, black=case != "light")
        show_picture(axes[row, 0], jump.after.frame, "the frame after the jump" if row == 0 else "")
        for column, way in enumerate(WAYS):
            one = chosen(found, case, way)[0]
            title = f"{len(one.splats)} centres {WAYS[way]}"
            show_centers(axes[row, 1 + 2 * column], one.splats.positions, size.width, size.height, title)
            show_picture(axes[row, 2 + 2 * column], one.frame, f"{one.psnr:.1f} dB")
    pictures = save_figure(figure, run.folder, "augmentation-pictures")
    figure, axes = new_figure(6.2, 3.8)
    for number, case in enumerate(CASES):
        for way, dashes in zip(WAYS, ("--", "-"), strict=True):
            means = [100 * fmean([one.coverage for one in chosen(found, case, way, t)]) for t in size.inter]
            line(axes[0, 0], size.inter, means, number, f"{CASES[case].partition(', ')[-1] or CASES[case]}, {way}",
                 linestyle=dashes)  # fmt: skip
    log_axis(axes[0, 0], size.inter)
    axes[0, 0].set(xlabel="iterations of the P-frame", ylabel="circle in its colour, % of its pixels", ylim=(-5, 105))
    figure.legend(loc="outside lower center", ncols=2)
    curve = save_figure(figure, run.folder, "augmentation-coverage")
    return {
        pictures: f"After the jump, by the paper's schedule with {max(size.inter):,} iterations, first random start. "
        f"Above: {CASES['light']}; middle: {CASES['black']}; below: {CASES['gone']}.",
        curve: "How much of the circle is there after how many iterations, mean over random starts; dashed: without.",
    }


def table(found: Sequence[Outcome]) -> Table:
    """Means over random starts."""
    rows = []
    for case, way, iterations in dict.fromkeys((one.case, one.way, one.iterations) for one in found):
        some = chosen(found, case, way, iterations)
        means = [100 * fmean([getattr(one, name) for one in some]) for name in ("coverage", "ghost")]
        quality = f"{fmean([one.psnr for one in some]):.2f}"
        rows.append((CASES[case], WAYS[way], f"{iterations:,}", quality, *(f"{mean:.0f}" for mean in means)))
    columns = ("frame before", "P-frame", "iterations", "PSNR, dB", "circle there, %", "old circle left, %")
    return Table("The frame after the jump, means over random starts", columns, tuple(rows))


def run(settings: Run) -> Result:
    """Fit the frame after the jump in all ways."""
    if settings.clips or settings.uvg:
        settings.say("this experiment is about a synthetic clip; --clip and --uvg change nothing here")
    size = FULL if settings.full else SMALL
    found = measure(size, settings)
    numbers = {
        "size": size,
        "frames": [
            {name: getattr(one, name) for name in ("case", "way", "iterations", "seed", "psnr", "coverage", "ghost")}
            for one in found
        ],
    }
    setting = (
        f"The scene {SCENE}, {size.width}x{size.height}, on its light background and on black; {size.splats:,} splats "
        f"in the frame before the jump, made by {size.intra:,} iterations of the paper's schedule from "
        f"{pruned_to(size.splats, PaperSettings.paper().intra):,} at random; {len(size.seeds)} random starts; before "
        f"quantisation. With GSA the frame after the jump begins with as many splats more as were pruned, at random "
        f"places and with w = 0.01, and GSP removes a tenth of all; without, with the splats of the frame before "
        f"alone. A third case keeps only the splats within a diameter of the old circle's centre, so that next to none "
        f"is at the new place."
    )
    conclusion = verdict(found).about(
        settings,
        f"{size.splats:,} splats on frames of {size.width}x{size.height}",
        f"--full takes {FULL.splats:,} on {FULL.width}x{FULL.height} and up to {max(FULL.inter):,} iterations",
    )
    return Result(setting, numbers, (table(found),), draw(size, found, settings), conclusion)


EXPERIMENT: Final = Experiment(
    "augmentation",
    "The jumping circle, with and without augmentation",
    "Figure 4 shows two frames of a synthetic video in which a circle jumps from the left to the right. Section 3.5 "
    "says that without GSA the splats are stuck in a local minimum and the frame comes out empty, and that with GSA "
    "the added splats capture the circle. Neither the frame's size nor other numbers are given; the caption, of 45,000 "
    "splats on Beauty, is of another figure.",
    run,
)
