"""Our stages: one process of the program `stages`, asked for one stage after another."""

import json
import subprocess
import sys

import numpy as np

from common import Took


class Ours:
    """Stages of a pair. One that fails is reported once and skipped from then on."""

    def __init__(self, binary, threads):
        self.command = [str(binary), "--serve", "--threads", str(threads)]
        self.missing, self.loaded, self.child = set(), None, None
        self._start()

    def _start(self):
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
        self.child = subprocess.Popen(self.command, text=True, **pipes)

    def _ask(self, request):
        try:
            self.child.stdin.write(json.dumps(request) + "\n")
            self.child.stdin.flush()
            line = self.child.stdout.readline()
        except BrokenPipeError:
            line = ""
        return json.loads(line) if line else {"error": f"stages ended with {self.child.wait()}"}

    def load(self, target, source, voxel_m, initial=None):
        """Sets the pair and the voxel."""
        self.loaded = {"target": str(target), "source": str(source), "voxel_m": voxel_m}
        if initial is not None:
            self.loaded["initial"] = np.asarray(initial).ravel().tolist()
        answer = self._ask({"load": self.loaded})
        if "error" in answer:
            raise RuntimeError(f"{target}, {source}: {answer['error']}")
        return answer["points"]

    def run(self, stage):
        """One run; None when the stage fails."""
        if stage in self.missing:
            return None
        answer = self._ask({"run": stage})
        if "error" in answer:
            print(f"skipped: our {stage}: {answer['error']}", file=sys.stderr)
            self.missing.add(stage)
            if self.child.poll() is not None:
                self._start()
                self._ask({"load": self.loaded})
            return None
        pose = answer.get("target_from_source")
        pose = None if pose is None else np.array(pose).reshape(4, 4)
        return Took(answer["cpu_ms"], answer["wall_ms"], answer["n_in"], answer["n_out"], pose, answer.get("stop"))

    def close(self):
        """Ends the process."""
        self.child.stdin.close()
        self.child.wait()
