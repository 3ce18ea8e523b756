"""The same readers under atheris, which looks for inputs that reach new code: ``python tests/fuzz/guided.py mat 60``.

For the readers in Python; it needs ``pip install atheris`` (CPython 3.11 to 3.13). The file that is read holds what
atheris gives, the others are those of a sample. It ends at the first finding, which lies in the working directory.
"""

import os
import sys
import tempfile
import time
from pathlib import Path

import atheris

MOST_BYTES = 1 << 16

with atheris.instrument_imports(include=["render", "sensor", "studies"]):
    from targets import TARGETS
    from worker import judge

target, seconds = TARGETS[sys.argv[1]], int(sys.argv[2])
samples = target.samples()
place = Path(tempfile.mkdtemp(prefix="rodcone-guided-"))
corpus, folder = place / "corpus", place / "place" / "in"
corpus.mkdir()
folder.mkdir(parents=True)
for number, sample in enumerate(samples):
    (corpus / str(number)).write_bytes(next(iter(sample.values())))
counts = {"refused": 0, "accepted": 0}


def one(content: bytes) -> None:
    """Read one input; what isn't a result or an `InputError` ends the run."""
    made = {**samples[0], next(iter(samples[0])): content}
    told, words = judge(target, made, folder)
    if told not in counts and told != "slow":  # coverage costs time
        raise AssertionError(f"{told}: {words}")
    counts["refused" if told == "slow" else told] += 1
    if time.monotonic() > end:
        print(f"{sum(counts.values())} inputs: {counts}", flush=True)
        os._exit(0)  # by itself the process would end with a signal of OpenEXR's threads, which reads like a finding


limits = [f"-max_len={MOST_BYTES}", "-rss_limit_mb=4096", f"-artifact_prefix={Path.cwd()}/"]
atheris.Setup([sys.argv[0], *limits, str(corpus)], one)
end = time.monotonic() + seconds
atheris.Fuzz()
