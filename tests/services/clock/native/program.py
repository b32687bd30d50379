"""What Python's waits come down to; times in ms since the program began."""

import asyncio
import multiprocessing
import os
import queue
import random
import select
import signal
import socket
import subprocess
import threading
import time

BEGIN = time.monotonic_ns()


def say(*words: object) -> None:
    print(*words, "at", (time.monotonic_ns() - BEGIN) // 1_000_000, flush=True)


def produce(items: "queue.Queue[int]") -> None:
    for number in range(3):
        time.sleep(0.01)
        items.put(number)


async def later() -> None:
    await asyncio.sleep(0.02)


def child(items: "multiprocessing.Queue[str]") -> None:
    time.sleep(0.05)
    items.put("from a child")


items: "queue.Queue[int]" = queue.Queue()
thread = threading.Thread(target=produce, args=(items,))
thread.start()
for _ in range(3):
    say("item", items.get(timeout=1))
thread.join()
try:
    items.get(timeout=0.02)
except queue.Empty:
    say("empty")
say("select", select.select([os.pipe()[0]], [], [], 0.01)[0])
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as bus:
    bus.bind(("127.0.0.1", 0))
    bus.settimeout(0.03)
    try:
        bus.recv(1)
    except TimeoutError:
        say("timeout")
signal.signal(signal.SIGALRM, lambda *_: say("alarm"))
signal.setitimer(signal.ITIMER_REAL, 0.01)
time.sleep(0.02)
asyncio.run(later())
say("asyncio")
say(
    "shell",
    subprocess.run(["/bin/sh", "-c", "sleep 2; echo slept"], capture_output=True, text=True, check=True).stdout.strip(),
)
messages = multiprocessing.get_context("fork").Queue()
process = multiprocessing.get_context("fork").Process(target=child, args=(messages,))
process.start()
say(messages.get(timeout=1))
process.join()
say("random", random.random(), os.urandom(4).hex())
