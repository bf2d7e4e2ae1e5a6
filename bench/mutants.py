#!/usr/bin/env python3
"""A seeded sample of mutants, each run against the tests of its own crate: python3 bench/mutants.py core --seed 1 --sample 300

Several parts, each with its share of the sample, are judged together: python3 bench/mutants.py core=14 drivers=6 --least-percent 85

Needs `cargo install cargo-mutants --locked`, which makes the mutants; what may be mutated is in .cargo/mutants.toml. Each is tried in a
copy of the tree under target/mutants, where only what the change touches is built again (`cargo mutants` itself builds every target of
the crate for every mutant, several times as long). Groups of tests run in turn, quick ones first, until one kills it. Each result is a
line in target/mutants/results.jsonl: started again, the same command goes on where it stopped; shards (--shard 2/4) may run on several
machines, their files joined.
"""

import argparse
import hashlib
import json
import math
import os
import pathlib
import random
import re
import shutil
import signal
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
WORK = ROOT / "target" / "mutants"
RESULTS = WORK / "results.jsonl"

PACKAGES = {"core": "slipbound", "drivers": "slipbound-rig"}

# A build or a group of tests that takes longer than this hangs, s: several times what they take on a busy machine.
BUILD_MOST_S = 1200
TESTS_MOST_S = 300


def tests(*names):
    return [f"--test={name}" for name in names]


# Groups of test binaries, quick ones first, and those that are only run with --long. Left out altogether: what reads the sources or the
# allocator instead of running the method (`conventions`, `import_cycles`, `no_alloc`), and `simd_parity`, about kernels that are not mutated here.
LIB = ["--lib"]
STATES = [*LIB, *tests("controllers", "events", "hand", "law_pictures", "task_pictures", "tasks")]
REPORTS, CYCLES, WIRES = tests("reports"), tests("cycles"), tests("wires")
PICTURES = tests("deviations", "faults", "gap", "rest_saved", "touch", "wrong_sensor")
LONG = tests("painted")


def groups_of(file, is_long):
    """The groups that can tell a change of this file."""
    if "slipbound-rig/" in file:
        return [WIRES, LIB, tests("links")]
    # What works on reports is tested with made-up ones.
    if re.search(r"/src/(events|hand|grip|task)\b", file):
        return [CYCLES, STATES] + is_long * [tests("control_loop")]
    return [REPORTS, LIB, PICTURES] + is_long * [LONG]


def main():
    arguments = parsed()
    WORK.mkdir(parents=True, exist_ok=True)
    tree = ROOT
    if not arguments.summary:
        tree = WORK / "tree"
        copy_tree(tree)
    samples, of = {}, {}
    for part, count in arguments.parts:
        mutants = listed(PACKAGES[part], tree)
        samples[part] = at_lines(mutants, arguments.at) if arguments.at else sampled(mutants, count or arguments.sample, arguments)
        of[part] = len(mutants)
    together = sum(samples.values(), [])
    if arguments.least_percent and together and 100 * wilson(0, len(together))[1] >= arguments.least_percent:
        sys.exit(f"{len(together)} mutants cannot show that fewer than {arguments.least_percent:g} % die: take more")
    if not arguments.summary:
        run_all(together, arguments)
    highest = [summary(part, chosen, of[part]) for part, chosen in samples.items()][-1]
    if len(samples) > 1:
        highest = summary(" and ".join(samples), together, sum(of.values()))
    done = results()
    for mutant in together:
        if done.get(mutant["key"], {}).get("outcome") == "survived":
            print(f"survived: {mutant['name']}")
    if 100 * highest < arguments.least_percent:
        sys.exit(f"fewer than {arguments.least_percent:g} % die, with 95 % certainty")


def parsed():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("parts", nargs="+", type=part_and_count, metavar="PART[=COUNT]", help="core or drivers, and how many of it")
    parser.add_argument("--seed", default="1", help="any text; the same one draws the same mutants")
    parser.add_argument("--sample", type=int, default=300, help="how many of a part that states no number")
    parser.add_argument("--shard", default="1/1", metavar="I/N", help="every N-th of the sample, from the I-th")
    parser.add_argument("--at", action="append", metavar="FILE:FIRST[-LAST]", help="instead: all mutants of these lines")
    parser.add_argument("--again", action="store_true", help="run again what survived, after new tests or with longer ones")
    parser.add_argument("--long", action="store_true", help="let the tests that take long have a go as well")
    parser.add_argument("--summary", action="store_true", help="run nothing, count what is there")
    parser.add_argument("--least-percent", type=float, default=0.0, help="fail where the whole interval lies below this share")
    parser.add_argument("--minutes", type=float, default=math.inf, help="begin no mutant after this time")
    return parser.parse_args()


def part_and_count(text):
    part, _, count = text.partition("=")
    if part not in PACKAGES:
        raise argparse.ArgumentTypeError(f"expected one of {', '.join(PACKAGES)}, got {part}")
    return part, int(count or 0)


def copy_tree(tree):
    """The tree as it stands, uncommitted changes too, in a place of its own; files that are the same stay untouched."""
    names = output("git", "ls-files", "-z", "--cached", "--others", "--exclude-standard").split("\0")
    wanted = {name for name in names if name and os.path.lexists(ROOT / name)}
    for old in [path for path in tree.rglob("*") if path.is_symlink() or path.is_file()]:
        if str(old.relative_to(tree)) not in wanted:
            old.unlink()
    for name in wanted:
        old, new = ROOT / name, tree / name
        new.parent.mkdir(parents=True, exist_ok=True)
        if old.is_symlink():
            if not new.is_symlink():
                new.unlink(missing_ok=True)
                new.symlink_to(old.readlink())
        elif not new.is_file() or new.read_bytes() != old.read_bytes():
            shutil.copy(old, new)


def listed(package, tree):
    found = json.loads(output("cargo", "mutants", "--list", "--json", "--diff", "-p", package, cwd=tree))
    digests = {}
    for mutant in found:
        file = mutant["file"]
        if file not in digests:
            digests[file] = hashlib.sha256((tree / file).read_bytes()).hexdigest()[:12]
        mutant["key"] = f"{digests[file]} {mutant['name']}"
    return sorted(found, key=lambda mutant: mutant["name"])


def sampled(mutants, count, arguments):
    chosen = random.Random(arguments.seed).sample(mutants, min(count, len(mutants)))
    index, count = (int(part) for part in arguments.shard.split("/"))
    return chosen[index - 1 :: count]


def at_lines(mutants, places):
    chosen = []
    for place in places:
        file, lines = place.rsplit(":", 1)
        first, last = (int(line) for line in (lines.split("-") * 2)[:2])
        chosen += [m for m in mutants if m["file"].endswith(file) and first <= m["span"]["start"]["line"] <= last]
    return chosen


def results():
    """The last result of each mutant, by its key: the sources it was made from and its name."""
    if not RESULTS.exists():
        return {}
    return {line["key"]: line for line in map(json.loads, RESULTS.read_text().splitlines())}


def run_all(chosen, arguments):
    began, done = time.monotonic(), results()
    again = {"survived"} if arguments.again else set()
    pending = [m for m in chosen if m["key"] not in done or done[m["key"]]["outcome"] in again]
    check_unchanged(pending, arguments)
    for number, mutant in enumerate(pending, 1):
        if time.monotonic() - began > 60 * arguments.minutes:
            break
        began_mutant = time.monotonic()
        outcome, by = judged(mutant, groups_of(mutant["file"], arguments.long))
        seconds = time.monotonic() - began_mutant
        line = {"outcome": outcome, "by": by, "seconds": round(seconds, 1), "name": mutant["name"], "key": mutant["key"]}
        with RESULTS.open("a") as file:
            file.write(json.dumps(line) + "\n")
        print(f"{number}/{len(pending)} {outcome:8} {seconds:5.0f} s  {mutant['name']}", flush=True)


TEST = ["cargo", "test", "--profile=mutants", "--locked"]


def judged(mutant, groups):
    """What became of a mutant, and the group of tests that said so."""
    source = WORK / "tree" / mutant["file"]
    as_it_was = source.read_text()
    source.write_text(changed(as_it_was, mutant["diff"]))
    try:
        for group in groups:
            if not is_built(mutant["package"], group):
                return "unviable", ""
            code = run([*TEST, f"--package={mutant['package']}", *group], TESTS_MOST_S)
            if code != 0:
                return "timeout" if code is None else "caught", " ".join(group)
        return "survived", ""
    finally:
        source.write_text(as_it_was)


def check_unchanged(pending, arguments):
    """What fails without any mutant tells nothing."""
    groups = {tuple(group): m["package"] for m in pending for group in groups_of(m["file"], arguments.long)}
    for group, package in groups.items():
        if not is_built(package, group) or run([*TEST, f"--package={package}", *group], TESTS_MOST_S) != 0:
            sys.exit(f"fails without a mutant: {' '.join(group)}\n{(WORK / 'last.log').read_text()[-4000:]}")


def is_built(package, group):
    """Builds tests; False where the crate is refused by the compiler."""
    if run([*TEST, f"--package={package}", *group, "--no-run"], BUILD_MOST_S) == 0:
        return True
    log = (WORK / "last.log").read_text()
    if f"could not compile `{package}`" not in log:
        sys.exit(f"not because of a mutant:\n{log[-4000:]}")
    return False


def changed(text, diff):
    """A text after a change in the unified format."""
    old, new, at = text.splitlines(keepends=True), [], 0
    for line in diff.splitlines(keepends=True)[2:]:
        if line.startswith("@@"):
            first = int(re.match(r"@@ -(\d+)", line)[1]) - 1
            new += old[at:first]
            at = first
        elif line.startswith("+"):
            new.append(line[1:])
        elif line.startswith(("-", " ")):
            if old[at] != line[1:]:
                sys.exit(f"not the text that was to be changed: {old[at]!r} for {line!r}")
            new += [line[1:]] if line[0] == " " else []
            at += 1
    return "".join(new + old[at:])


def run(command, most_s):
    """The exit code of a command; None, and its children ended too, where it took longer than that."""
    environment = dict(os.environ, CARGO_TARGET_DIR=str(WORK / "build"), CARGO_INCREMENTAL="1")
    # A million random cases take a minute; so many find what the first of them find.
    environment["SLIPBOUND_NOISE_CASES"] = "26000"
    with (WORK / "last.log").open("w") as log:
        began = subprocess.Popen(command, cwd=WORK / "tree", env=environment, stdout=log, stderr=log, start_new_session=True)
        try:
            return began.wait(most_s)
        except subprocess.TimeoutExpired:
            os.killpg(began.pid, signal.SIGKILL)
            began.wait()
            return None


def summary(part, chosen, of):
    """Prints what is known; returns the upper end of the interval."""
    done = results()
    lines = [done[m["key"]] for m in chosen if m["key"] in done]
    count = {name: sum(line["outcome"] == name for line in lines) for name in ("caught", "timeout", "survived", "unviable")}
    killed, viable = count["caught"] + count["timeout"], len(lines) - count["unviable"]
    print(f"{part}: {len(lines)} of {len(chosen)} run, of {of} there are: " + ", ".join(f"{n} {name}" for name, n in count.items()))
    low, high = wilson(killed, viable) if viable else (0.0, 1.0)
    if viable:
        print(f"{100 * killed / viable:.1f} % of {viable} viable ones die (95 % interval {100 * low:.1f} to {100 * high:.1f} %)")
    return high


def wilson(hits, count, z=1.959964):
    """Wilson's interval of a share."""
    share, scale = hits / count, 1 + z * z / count
    middle = (share + z * z / (2 * count)) / scale
    half = z / scale * math.sqrt(share * (1 - share) / count + z * z / (4 * count * count))
    return middle - half, middle + half


def output(*command, cwd=ROOT):
    return subprocess.run(command, cwd=cwd, check=True, stdout=subprocess.PIPE, text=True).stdout


if __name__ == "__main__":
    main()
