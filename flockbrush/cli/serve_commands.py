"""Implementation of ``flockbrush serve``."""

from __future__ import annotations

import ipaddress
import sys
import warnings

from flockbrush.cli.level_commands import recorder_of, use_threads, wrote_recording
from flockbrush.cli.run_options import ServeOptions
from flockbrush.cli.shared_options import wrong
from flockbrush.engine import limits
from flockbrush.engine.files import output_problems
from flockbrush.engine.problems import ProblemsError
from flockbrush.output.live.link import EVERYWHERE
from flockbrush.output.live.serving import Serving
from flockbrush.runs import run as running
from flockbrush.runs import terminal
from flockbrush.runs.compile_ahead import compiling_ahead
from flockbrush.runs.kernel_helper import rehearse
from flockbrush.runs.terminal import print_json, print_line, say


def serve_level(service: ServeOptions):
    """Run a level for clients until Ctrl-C, or for the given seconds."""
    if service.seconds is not None and not service.seconds <= limits.TICKS / 32:
        raise wrong("--seconds", f"must be a finite number of seconds, got {service.seconds}")
    problems = output_problems([service.record] if service.record else [], [running.find_level(service.level)])
    if problems:
        raise ProblemsError(problems)
    use_threads(service.threads)
    world = service.level, service.seed, service.agents, service.brush
    with terminal.Interrupts() as interrupts, compiling_ahead(*world):
        with warnings.catch_warnings(action="ignore"):  # the start itself tells
            rehearse(name=service.level, seed=service.seed, agents=service.agents, brush=service.brush)
        simulation = running.start(*world)
        serving = Serving(simulation, service.host, service.port, service.frame_rate, say=say)
        serving.link.start()
        _announce(service, serving.link)
        with recorder_of(service.record, simulation) as recorder:
            serving.after_tick = recorder.take if recorder else serving.after_tick
            interrupts.gently()
            serving.run(lambda: interrupts.asked, service.seconds)
    say(f"stopped after tick {simulation.clock.tick}")
    if service.record:
        tell = say if service.json else print_line
        tell(wrote_recording(service.record))


def _announce(service, link):
    """Print the address of the link at once, before the first tick."""
    if not _is_local(service.host):
        say(f"{service.host}: other machines can connect, and others can read the token: nothing is encrypted")
    if service.json:
        print_json({"address": link.address, "host": link.host, "port": link.port, "token": link.token}, indent=None)
    else:
        print_line(f"{service.level}: {link.address}")
        if link.host in EVERYWHERE:
            print_line(f"For other machines, put the address of this one in place of {EVERYWHERE[link.host]}.")
        print_line("Anyone who has this address can control the herd. Ctrl-C stops.")
    sys.stdout.flush()


def _is_local(host):
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
