"""Measure the age of live-link frames when a client has read them.

    python benchmarks/live_link.py [--agents 2000] [--seconds 60] [--clients 2] [--level meadow] [--json]

``flockbrush serve`` and the clients run in processes of their own.  The age of a frame is the time from the end of the
newest tick in it until the client has read and unpacked it.  One client sends a command every second, and one more
client never reads.  Goal: 99 % of the frames with 2,000 animals are younger than 100 ms.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import subprocess
import sys
import time

import numpy as np

GOAL = 100.0  # ms


def watch(address, seconds, steers, found):
    """Read frames and put their ages into the queue."""
    from websockets.sync.client import connect

    from flockbrush.output.live.frame import unpack

    ages, count = [], 0
    with connect(address, max_size=None, compression=None) as link:
        end = time.monotonic() + seconds
        asked = time.monotonic()
        while time.monotonic() < end:
            message = link.recv()
            if isinstance(message, bytes):
                frame = unpack(message)
                count = len(frame["id"])
                ages.append(time.time() - frame["made"])
            if steers and time.monotonic() - asked > 1:
                asked = time.monotonic()
                link.send(json.dumps({"id": 1, "command": ["Gust", {"x": 0.5, "y": 0.0, "seconds": 0.2}]}))
    found.put((count, seconds, ages))


def sleep(address, seconds):
    """Connect and never read."""
    import socket
    from urllib.parse import urlsplit

    where = urlsplit(address)
    with socket.create_connection((where.hostname, where.port)) as plain:
        plain.sendall(
            f"GET /?{where.query} HTTP/1.1\r\nHost: here\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        time.sleep(seconds)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--agents", type=int, default=2000)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--clients", type=int, default=2)
    parser.add_argument("--level", default="meadow")
    parser.add_argument("--json", action="store_true")
    wanted = parser.parse_args()
    command = [sys.executable, "-m", "flockbrush", "serve", wanted.level, "--agents", str(wanted.agents), "--json"]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    told = ""
    while not told.rstrip().endswith("}"):
        told += server.stdout.readline()
    address = json.loads(told)["address"]
    time.sleep(8)  # the first tick loads the kernels
    found = multiprocessing.Queue()
    jobs = [
        multiprocessing.Process(target=watch, args=(address, wanted.seconds, k == 0, found))
        for k in range(wanted.clients)
    ]
    jobs.append(multiprocessing.Process(target=sleep, args=(address, wanted.seconds)))
    for job in jobs:
        job.start()
    results = [found.get() for _ in range(wanted.clients)]
    for job in jobs:
        job.join()
    server.terminate()
    server.wait()
    ages = 1e3 * np.concatenate([one for _, _, one in results])
    report = {
        "level": wanted.level,
        "animals": results[0][0],
        "seconds": wanted.seconds,
        "frames_per_second": [round(len(one) / seconds, 1) for _, seconds, one in results],
        "age_ms": {f"p{share:g}": round(float(np.percentile(ages, share)), 1) for share in (50, 95, 99, 100)},
        "goal_ms": GOAL,
        "met": bool(np.percentile(ages, 99) < GOAL),
    }
    print(json.dumps(report, indent=2) if wanted.json else "\n".join(f"{k}: {v}" for k, v in report.items()))


if __name__ == "__main__":
    main()
