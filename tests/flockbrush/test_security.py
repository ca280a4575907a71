"""What SECURITY.md promises: no code from files, no network unless asked, encryption where it is asked for."""

import ast
import json
import subprocess
import sys

import pytest
from clusters import dask_cluster
from processes import HOUSE, environment, other_process
from test_sweep import FLOCKS, sweep_file

from flockbrush.studies.sweep import JOURNAL

ROOMS = ("engine", "components", "behaviours", "systems", "levels", "flockbrush")
RUNS_CODE = {"pickle", "marshal", "shelve", "dill", "cloudpickle", "joblib", "yaml", "code", "runpy"}
TALKS = {
    "urllib",
    "http",
    "requests",
    "httpx",
    "aiohttp",
    "ftplib",
    "smtplib",
    "telnetlib",
    "socketserver",
    "xmlrpc",
    "websockets",
    "asyncio",
}
SERVE = "flockbrush/output/live/"  # the command that listens when it is asked to
LISTENS_TO_NOBODY = """
import sys
sys.addaudithook(lambda name, given: (_ for _ in ()).throw(PermissionError(f"{name} {given}"))
                 if name in ("socket.connect", "socket.bind", "socket.sendto", "socket.getaddrinfo", "urllib.Request")
                 and (len(given) < 2 or not isinstance(given[1], (str, bytes))) else None)
from flockbrush.cli.main import called
import json
for words in json.loads(sys.argv[1]):
    assert called(words) == 0, words
"""


def sources():
    return [path for room in ROOMS for path in (HOUSE / room).rglob("*.py")]


def imported(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (name.name.split(".")[0] for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module.split(".")[0]


def called(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            yield ast.unparse(node.func), {one.arg: ast.unparse(one.value) for one in node.keywords}


def test_no_module_runs_code_from_files_starts_a_shell_or_talks_to_the_network():
    paths = sources()
    assert len(paths) > 200
    for path in paths:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        used = set(imported(tree))
        assert not used & RUNS_CODE, path
        assert not used & TALKS or f"/{SERVE}" in path.as_posix(), path
        for name, words in called(tree):
            assert name not in ("eval", "exec", "os.system", "os.popen", "torch.load"), path
            assert words.get("allow_pickle", "False") == "False", path
            assert words.get("shell", "False") == "False", path
            assert name not in ("np.load", "numpy.load") or words.get("allow_pickle") == "False", path


def test_no_command_opens_a_connection(level):
    commands = ["run", str(level), "--ticks", "3"], ["doctor"], ["level", "check", str(level)]
    done = subprocess.run(
        [sys.executable, "-c", LISTENS_TO_NOBODY, json.dumps(commands)],
        env=environment(), capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "PermissionError" not in done.stderr


# an encrypted cluster ------------------------------------------------------------------------


@pytest.fixture(scope="module")
def certificates(tmp_path_factory):
    """(authority, certificate, key) of a cluster, and the same of somebody else."""
    folder, both = tmp_path_factory.mktemp("certificates"), []
    for name in ("ours", "theirs"):
        cert, key = folder / f"{name}.pem", folder / f"{name}.key"
        try:
            subprocess.run(
                ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=localhost",
                 "-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1", "-keyout", key, "-out", cert],
                check=True, capture_output=True, timeout=120,
            )  # fmt: skip
        except FileNotFoundError:
            pytest.skip("openssl is not installed")
        both.append((cert, cert, key))
    return both


def tls(files):
    return ["--tls-ca", files[0], "--tls-cert", files[1], "--tls-key", files[2]]


def test_a_sweep_runs_on_an_encrypted_cluster_and_nobody_else_gets_in(cli, certificates, tmp_path):
    """The certificates are named by options, or by the settings of Dask."""
    ours, theirs = certificates
    file, prefix = sweep_file(tmp_path, FLOCKS.replace("count = 6", "count = 1")), "DASK_DISTRIBUTED__COMM__TLS__"
    settings = {"CA_FILE": ours[0], "CLIENT__CERT": ours[1], "CLIENT__KEY": ours[2]}
    settings = {f"{prefix}{name}": path for name, path in settings.items()}
    with dask_cluster(1, tls=ours) as (address, _):
        assert address.startswith("tls://")
        words = ["sweep", file, "--cluster", address, "--out"]
        done = cli(*words, tmp_path / "out", *tls(ours))
        assert done.code == 0, done.err
        done = other_process(*words, tmp_path / "set", **settings)
        assert done.returncode == 0, done.stderr
        assert (tmp_path / "out" / JOURNAL).is_file() and (tmp_path / "set" / JOURNAL).is_file()
        refused = other_process(*words, tmp_path / "no")
        assert refused.returncode == 1
        said = f"{address}: no Dask scheduler answers at this address"
        hint = "without certificates (--tls-ca, --tls-cert and --tls-key, or the settings of Dask)"
        assert f"{said} {hint}: " in refused.stderr
        assert "Traceback" not in refused.stderr and "Exception ignored" not in refused.stderr
        refused = cli(*words, tmp_path / "no", *tls(theirs))
        assert refused.code == 1 and f"{said}: " in refused.err and "Exception ignored" not in refused.err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--cluster", "tcp://127.0.0.1:1", "--tls-ca", "HERE"], "with --tls-..., the address must begin with tls://"),
        (["--cluster", "tls://127.0.0.1:1", "--tls-key", "none.pem"], "none.pem: there is no such file"),
        (["--tls-cert", "HERE"], "certificates can only be used with --cluster tls://HOST:PORT"),
    ],
)
def test_files_of_an_encrypted_connection_that_make_no_sense_are_refused(cli, tmp_path, words, said):
    pytest.importorskip("distributed", reason="dask is not installed: pip install 'flockbrush[cluster]'")
    (tmp_path / "here.pem").touch()
    words = [tmp_path / "here.pem" if word == "HERE" else word for word in words]
    done = cli("sweep", sweep_file(tmp_path), "--out", tmp_path / "out", *words)
    assert done.code in (1, 2)
    assert said in " ".join(done.err.split())
