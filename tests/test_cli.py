"""The command line: what it writes, and one clear line with exit code 2 for what is wrong."""

from __future__ import annotations

import importlib
import itertools
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from rich.console import Console

import cuticle
from command import refused, run, run_program
from cuticle._support.progress import Progress, expect
from cuticle.cli import fit as fit_command
from cuticle.cli import terminal
from cuticle.cli.app import COMMANDS, load
from cuticle.export.hosts import web


@pytest.fixture(scope="module")
def fitted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cli") / "brown"
    done = run("fit", "brown", "--strands", "0,2", "--lobes", "3", "-o", str(folder))
    assert done.returncode == 0, done.stderr
    assert "ESS" in done.stdout
    assert str(folder / "sampler.json") in done.stdout
    return folder


def test_fit_writes_what_it_says(fitted: Path) -> None:
    sampler = cuticle.Sampler.load(fitted / "sampler.json")
    assert sampler.lobes == 3
    assert sampler.strands == (0, 2)
    assert cuticle.Fibre.load(fitted / "fibre.toml") == cuticle.Fibre.preset("brown")
    summary = json.loads((fitted / "fit.json").read_text())
    assert summary["strands"] == [0, 2]
    assert min(summary["ess"][0]) > 0.9


def test_fit_takes_the_family_asked_for(tmp_path: Path) -> None:
    run("fit", "brown", "--strands", "0", "--lobes", "2", "--family", "logistic", "-o", "out", cwd=tmp_path)
    assert cuticle.Sampler.load(tmp_path / "out").family == "logistic"


def test_fit_leaves_no_other_models_parameters_beside_its_sampler(tmp_path: Path) -> None:
    cuticle.Chiang(sigma_a=1).save(tmp_path / "chiang.toml")
    refused("fit", "brown", "-o", ".", words="chiang.toml describes another model than this fit's; move it", cwd=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["chiang.toml"]


def test_fit_reads_a_file_and_prints_json(tmp_path: Path) -> None:
    cuticle.Fibre(beta_R=9, sigma_a=0.8).save(tmp_path / "mine.toml")
    done = run("fit", "mine.toml", "--strands", "1", "--lobes", "2", "--json", "-o", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["lobes"] == 2


def test_check_passes_and_writes_a_report(fitted: Path, tmp_path: Path) -> None:
    done = run("check", str(fitted), "--quick", "-o", str(tmp_path / "report.json"))
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Verdicts" in done.stdout
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["ok"] is True
    assert report["samples"] == 100_000
    printed = run("check", str(fitted / "sampler.json"), "--samples", "20000", "--json", "--strands", "2")
    assert json.loads(printed.stdout)["samples"] == 20000


def test_check_fails_with_code_1(fitted: Path, tmp_path: Path) -> None:
    """A sampler that covers a corner of the sphere only: its weights have no bound."""
    data = json.loads((fitted / "sampler.json").read_text())
    for row in data["nodes"]:
        for node in row:
            node[1:] = [[0.1] * 3, [0.02] * 3, [0.5] * 3, [0.02] * 3]
    (tmp_path / "corner.json").write_text(json.dumps(data))
    done = run("check", "corner.json", "--samples", "20000", cwd=tmp_path)
    assert done.returncode == 1, done.stderr
    assert "FAIL" in done.stdout


def test_fibres() -> None:
    done = run("fibres")
    assert done.returncode == 0
    assert "marschner" in done.stdout
    assert cuticle.Fibre.from_toml(run("fibres", "--toml", "black").stdout) == cuticle.Fibre.preset("black")
    assert set(json.loads(run("fibres", "--json").stdout)) == set(cuticle.presets.PRESETS)


def test_help() -> None:
    for arguments in ((), ("--help",), ("fit", "--help"), ("check", "--help")):
        done = run(*arguments)
        assert done.returncode == 0
        assert "Usage" in done.stdout


@pytest.mark.parametrize(("given", "threads"), [({}, "1"), ({"OPENBLAS_NUM_THREADS": "3"}, "3")])
def test_the_command_has_one_thread_for_blas_unless_told(given: dict[str, str], threads: str) -> None:
    code = """import atexit, os, sys, cuticle_command
atexit.register(lambda: print(os.environ["OPENBLAS_NUM_THREADS"]))
assert "numpy" not in sys.modules
sys.argv = ["cuticle", "--version"]
cuticle_command.main()"""
    environment = {k: v for k, v in os.environ.items() if k != "OPENBLAS_NUM_THREADS"} | given
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.split()[-1] == threads


@pytest.mark.parametrize("name", COMMANDS)
def test_help_prints_each_text_as_it_is_written(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rich takes [words] for its markup, and leaves them out."""
    monkeypatch.setenv("COLUMNS", "400")
    group = load(name)
    for path, command in [((name,), group), *(((name, k), c) for k, c in getattr(group, "commands", {}).items())]:
        printed = " ".join(re.sub("[│╭╮╰╯─]", " ", run(*path, "--help").stdout).split())
        for parameter in command.params:
            assert " ".join((parameter.help or "").split()) in printed


def test_the_program_starts_and_ends_as_its_function_does(tmp_path: Path) -> None:
    for arguments, code in ((("fibres", "--json"), 0), (("fit", "red", "-o", "x"), 2)):
        program, function = (go(*arguments, cwd=tmp_path) for go in (run_program, run))
        assert program.returncode == function.returncode == code
        assert program.stdout == function.stdout
        assert program.stderr == function.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("fit", "red", "-o", "x"), "a scattering function must be a preset (document, marschner, blond, brown, black)"),
        (("fit", "none.toml", "-o", "x"), "cannot read model none.toml: No such file or directory"),
        (("fit", "broken.toml", "-o", "x"), "broken.toml is not valid TOML"),
        (("fit", "range.toml", "-o", "x"), "range.toml: beta_R must be in [0.1, 60] degrees, got 400"),
        (("fit", "nan.toml", "-o", "x"), "nan.toml: eta must be in (1, 3], got nan"),
        (("fit", "clear.toml", "-o", "x"), "a_f + a_b, must stay below 1"),
        (("fit", "brown", "-o", "x", "--lobes", "0"), "--lobes must be in [1, 32], got 0"),
        (("fit", "brown", "-o", "x", "--lobes", "four"), "--lobes must be a whole number from 1 to 32 or auto"),
        (("fit", "brown", "-o", "x", "--strands", "-1"), "--strands must be in [0, 10000], got -1"),
        (("fit", "brown", "-o", "x", "--strands", "1,x"), "--strands must be numbers with commas between"),
        (("fit", "brown", "-o", "x", "--strands", "2,1"), "--strands must be increasing, got 2, 1"),
        (("fit", "brown", "-o", "x", "--form", "gauss"), "--form must be one of lobes, document"),
        (("fit", "brown", "-o", "x", "--objective", "red"), "--objective must be one of luminance, rgb"),
        (("fit", "brown", "-o", "x", "--defensive", "2"), "--defensive must be in [0, 0.99], got 2"),
        (("fit", "brown", "-o", "a-file/x"), "cannot write to a-file/x: a-file is a file"),
        (("fit", "brown"), "Missing option '-o'"),
        (("fit", "brown", "-o", "x", "--speed", "9"), "No such option: --speed"),
        (("check", "none.json"), "cannot read sampler none.json: No such file or directory"),
        (("check", "brown"), "brown is a fibre, not the file of a sampler: `cuticle fit brown -o brown` makes one"),
        (("check", "cut.json"), "it ends early (truncated?)"),
        (("check", "newer.json"), "newer than 1; upgrade cuticle"),
        (("check", "good.json", "--samples", "3"), "samples must be in [10000, 1e+08], got 3"),
        (("check", "good.json", "--fibre", "red"), "must be a preset"),
        (("check", "good.json", "-o", "none/r.json", "--samples", "10000"), "cannot write to none: No such file"),
        (("fibres", "--toml", "red"), "preset must be one of"),
        (("paint",), "No such command 'paint'"),
    ],
)  # fmt: skip
def test_bad_input(arguments: tuple[str, ...], words: str, fitted: Path, tmp_path: Path) -> None:
    good = (fitted / "sampler.json").read_text()
    (tmp_path / "good.json").write_text(good)
    (tmp_path / "cut.json").write_text(good[:-200])
    (tmp_path / "newer.json").write_text(good.replace('"version": 1', '"version": 9'))
    (tmp_path / "broken.toml").write_text("[fibre\n")
    (tmp_path / "range.toml").write_text("[fibre]\nbeta_R = 400\nsigma_a = 1\n")
    (tmp_path / "nan.toml").write_text("[fibre]\neta = nan\nsigma_a = 1\n")
    (tmp_path / "clear.toml").write_text("[fibre]\nsigma_a = 0.0\n")
    (tmp_path / "a-file").write_text("")
    refused(*arguments, words=words, cwd=tmp_path)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_read_only_folder(tmp_path: Path) -> None:
    folder = tmp_path / "locked"
    folder.mkdir(mode=0o555)
    refused("fit", "brown", "-o", str(folder), words="Permission denied", cwd=tmp_path)


def test_a_failed_write_leaves_no_half_file(tmp_path: Path) -> None:
    from cuticle._support.files import write_text

    (tmp_path / "taken").mkdir()
    with pytest.raises(ValueError, match="cannot write"):
        write_text(tmp_path / "taken", "text")
    assert [p.name for p in tmp_path.iterdir()] == ["taken"]
    assert not list((tmp_path / "taken").iterdir())


@pytest.fixture(scope="module")
def documented(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("document")
    cuticle.Fibre(alpha_R=-3, beta_R=8, sigma_a=(0.2, 0.3, 0.8), beta_N=15).save(folder / "mine.toml")
    done = run("document", "mine.toml", "-o", "out", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "Table 3" in done.stdout
    assert "float sigma_V = " in done.stdout
    return folder


@pytest.mark.slow
def test_document_and_report_of_a_fibre_of_ones_own(documented: Path) -> None:
    data = json.loads((documented / "out" / "document.json").read_text())
    assert data["name"] == "mine"
    assert data["fibre"]["sigma_a"] == [0.2, 0.3, 0.8]
    assert all(r["theta_i_deg"]["printed"] is None for r in data["table_1"]["rows"])  # those are of another fibre
    for figure in data["figures"].values():
        for kind in (".svg", ".png"):
            assert (documented / "out" / figure["file"]).with_suffix(kind).stat().st_size > 10_000
    done = run("report", "out", cwd=documented)
    assert done.returncode == 0, done.stderr
    assert "The fibre “mine”" in (documented / "out" / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_document_prints_json_with_the_printed_tables(data: Path, tmp_path: Path) -> None:
    done = run("document", "--json", "--printed", str(data / "document"), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["table_2"]["rms"]["sigma_H"] < 0.03
    assert found["functions_from_printed"]["mu_H"]["best"]["code"].startswith("-0.038")
    assert list(tmp_path.iterdir()) == []  # nothing written unless asked


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("document", "nobody"), "must be a preset"),
        (("document", "--printed", "nowhere"), "table1.csv is missing"),
        (("report", "nowhere"), "is not a folder"),
        (("report", "."), "holds none of fit.json, check.json, document.json"),
        (("report",), "Missing argument"),
    ],
)
def test_document_and_report_refuse_bad_input(arguments: tuple[str, ...], words: str, tmp_path: Path) -> None:
    refused(*arguments, words=words, cwd=tmp_path)


@pytest.mark.parametrize("name", COMMANDS)
def test_the_list_of_commands_says_what_each_says_of_itself(name: str) -> None:
    assert load(name).help.splitlines()[0] == COMMANDS[name]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("audit", "d.npz", "--strands", "2"), "--strands does nothing for a file of samples"),
        (("audit", "d.csv", "--energy"), "--energy does nothing for a file of samples"),
        (("audit", "SAMPLER", "--variant", "nope"), "--variant does nothing for a sampler's file"),
        (("audit", "SAMPLER", "--h", "0.0"), "--h does nothing for a sampler's file"),
        (("audit", "mitsuba:hair", "--strands", "2"), "--strands does nothing for a plugin"),
        (("fit", "brown", "--defensive", ".1", "-o", "out"), "--defensive does nothing without --form document"),
        (("fit", "brown", "--form", "document", "--lobes", "3", "-o", "out"), "--lobes does nothing with --form document"),
        (("render", "lock", "--depth", "3", "-o", "a.png"), "--depth does nothing without --integrator path"),
        (
            ("render", "lock", "--fibre", "a.json", "--sampling", "lobes", "-o", "a.png"),
            "--sampling does nothing for a sampler's",
        ),
        (("fibres", "--allow-large"), "No such option: --allow-large"),
        (("render", "lock", "--spread", "3", "-o", "a.png"), "--spread does nothing without --followers"),
        (("render", "lock", "--exposure", "1", "-o", "a.exr"), "--exposure does nothing for an .exr"),
        (("render", "lock", "--exposure", "nan", "-o", "a.png"), "--exposure must be in [-32, 32] stops, got nan"),
        (("render", "lock", "--exposure", "1e9", "-o", "a.png"), "--exposure must be in [-32, 32] stops, got 1e+09"),
        (("render", "lock", "--seed", "-1", "-o", "a.png"), "--seed must be in [0, 10000], got -1"),
        (("render", "lock", "--radius", "0", "-o", "a.png"), "--radius must be in (0, 1e+06], got 0"),
        (("render", "compare", "lock", "--radius", "nan", "-o", "a"), "--radius must be in (0, 1e+06], got nan"),
        (("render", "lock", "--radius", "1", "--tip", "-1", "-o", "a.png"), "--tip must be in [0, 1e+06], got -1"),
        (("render", "lock", "--strength", "inf", "-o", "a.png"), "strength must be in (0, 1e+06], got inf"),
        (("render", "lock", "--zoom", "nan", "-o", "a.png"), "zoom must be in [0.1, 100], got nan"),
        (("check", "SAMPLER", "--samples", "0"), "--samples must be in [10000, 1e+08], got 0"),
        (("audit", "SAMPLER", "--level", "nan"), "--level must be in [1e-09, 0.5], got nan"),
        (("check", ""), "an argument is empty: ''"),
        (("fit", "brown", "--output="), "an argument is empty: --output="),
        (("report", ""), "an argument is empty"),
    ],
)
def test_what_does_nothing_and_what_is_no_value_is_refused_before_any_work(
    arguments: tuple[str, ...], words: str, fitted: Path, tmp_path: Path
) -> None:
    refused(*(str(fitted) if a == "SAMPLER" else a for a in arguments), words=words, cwd=tmp_path)


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_knows_commands_and_their_options(shell: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("_CUTICLE_COMPLETE", "_TYPER_COMPLETE_ARGS", "COMP_WORDS", "COMP_CWORD"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("_CUTICLE_COMPLETE", f"complete_{shell}")
    monkeypatch.setenv("_TYPER_COMPLETE_FISH_ACTION", "get-args")
    for line, expected in (("cuticle fi", {"fit", "fibres"}), ("cuticle fit --fo", {"--form"})):
        monkeypatch.setenv("_TYPER_COMPLETE_ARGS", line)
        monkeypatch.setenv("COMP_WORDS", line)
        monkeypatch.setenv("COMP_CWORD", str(len(line.split()) - 1))
        found = run().stdout
        assert all(word in found for word in expected), found
        assert "audit" not in found


def test_options_that_do_nothing_for_this_sampler_are_refused(fitted: Path, tmp_path: Path) -> None:
    done = run("check", str(fitted), "-o", "-", "--json")
    assert done.returncode == 2
    assert "--json does nothing with -o -" in done.stderr
    unknown = json.loads((fitted / "sampler.json").read_text(encoding="utf-8")) | {"about": {}}
    (tmp_path / "a.json").write_text(json.dumps(unknown), encoding="utf-8")
    words = "--energy does nothing for a sampler without its scattering function: leave it out"
    refused("audit", str(tmp_path / "a.json"), "--energy", words=words, cwd=tmp_path)


def told(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Return the list that gets every share of the work that a command tells."""
    shares: list[float] = []
    call = terminal.Watch.__call__
    monkeypatch.setattr(terminal.Watch, "__call__", lambda bar, phase, f: (shares.append(f), call(bar, phase, f)))
    return shares


def test_long_work_says_about_how_long(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    now = 0.0
    monkeypatch.setattr(terminal.time, "monotonic", lambda: now)
    monkeypatch.setattr(terminal, "err", Console(stderr=True))
    with terminal.progress_bar() as progress:
        for phase, seconds in (("loading", 1), ("rendering, {} of 64 samples", 160), ("writing {}", 10)):
            for k in range(65):
                progress(phase.format(k), k / 64)
                now += seconds / 64
    said = capsys.readouterr().err.splitlines()
    assert said == ["rendering: about 158 s more"]
    with terminal.progress_bar() as progress:  # what is known before is not estimated again
        for seconds in (19, 160):
            expect(progress, seconds)
        for k in range(65):
            progress("rendering", k / 64)
            now += 160 / 64
    assert capsys.readouterr().err.splitlines() == ["this takes about 160 s"]
    with terminal.progress_bar(quiet=True) as progress:
        expect(progress, 160)
    assert capsys.readouterr().err == ""


def test_a_comparison_in_a_traced_variant_says_how_long_it_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    """A first pass of 5 s, which compiles, and a second of 4 s for 8 samples: 128 s for 256, and eight times 5 + 3 s."""
    pytest.importorskip("mitsuba")
    compare = importlib.import_module("cuticle.render.compare")
    clock = [SimpleNamespace(seconds=s) for s in (5.0, 9.0)]
    for name, result in (("load_scene", None), ("expected_seconds", None), ("passes", clock)):
        monkeypatch.setattr(compare, name, lambda *_, result=result, **__: result)
    monkeypatch.setattr(compare, "render", lambda *_, **__: pytest.fail("it renders before it says how long that takes"))
    told: list[float] = []

    def stop(seconds: float) -> None:
        told.append(seconds)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        compare.compare_samplings(None, "brown", seconds=3, reference_spp=256, progress=SimpleNamespace(expect=stop))
    assert told == [128 + 8 * (5 + 3)]


def test_a_page_says_which_lobes_it_fits_and_how_long_that_takes(
    fitted: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Its fit of one lobe took 10 s, by a clock of our own: those of 2, 4 and 8 lobes take 1, 1.3 and 2.6 times as long, and
    all fits are .8 of the work."""
    shares = told(monkeypatch)
    monkeypatch.setattr(web, "time", SimpleNamespace(perf_counter=itertools.count(0, 10).__next__))
    monkeypatch.setattr(web, "fit", lambda *_, **__: SimpleNamespace(sampler=cuticle.Sampler.load(fitted / "sampler.json")))
    done = run("export", str(fitted), "--to", "web", "-o", str(tmp_path / "a.html"))
    assert done.returncode == 0, done
    assert done.stderr.splitlines() == [
        "the page compares this sampler with others of 1, 2, 4, 8 lobes, which are fitted now",
        "this takes about 74 s",
    ]
    assert shares == sorted(shares)


def test_a_plugin_is_read_and_fitted_under_one_bar(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def read(_: str, __: object, *, progress: Progress) -> cuticle.Chiang:
        for fraction in (0.0, 0.5, 1.0):
            progress("reading", fraction)
        return cuticle.Chiang(eumelanin=1.3)

    shares = told(monkeypatch)
    monkeypatch.setattr(fit_command, "read_model", read)
    assert run("fit", "mitsuba:hair", "--lobes", "2", "-o", str(tmp_path)).returncode == 0
    assert shares == sorted(shares)
    assert shares[:3] == [0.0, 0.45, 0.9]
    assert shares[-1] == 1


def test_a_files_name_is_printed_as_it_is(fitted: Path, tmp_path: Path) -> None:
    name = "[/b] :smile: [red].json"
    (tmp_path / "[").mkdir()
    done = run("export", str(fitted), "--to", "json", "-o", name, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"wrote {name}: ")


def test_help_for_want_of_a_command_is_no_error_line() -> None:
    for group in ("render", "reference"):
        done = run(group)
        assert (done.returncode, done.stderr) == (2, "")
        assert f"Usage: cuticle {group}" in done.stdout
