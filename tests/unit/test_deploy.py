"""The files for Kubernetes and compose name settings, commands and parts that exist."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from service.cli.commands import _parser
from service.settings import Settings, setting_variables

PROJECT = Path(__file__).parent.parent.parent
FOLDER = PROJECT / "deploy"
MONITORING = FOLDER / "monitoring"
SECRET = {
    "MPE_DATABASE_URL": "postgresql://mpe:word@postgres/mpe",
    "MPE_BLOB_ACCESS_KEY_ID": "key",
    "MPE_BLOB_SECRET_ACCESS_KEY": "secret",
}
KNOWN = {name for name, _ in setting_variables()}


def objects(kind: str) -> list[dict[str, Any]]:
    names = yaml.safe_load((FOLDER / "kustomization.yaml").read_text())["resources"]
    found = [each for name in names for each in yaml.safe_load_all((FOLDER / name).read_text())]
    return [each for each in found if each["kind"] == kind]


DEPLOYMENTS = objects("Deployment")
each_deployment = pytest.mark.parametrize(
    "deployment", DEPLOYMENTS, ids=lambda d: d["metadata"]["name"]
)


def container(deployment: dict[str, Any]) -> dict[str, Any]:
    (only,) = deployment["spec"]["template"]["spec"]["containers"]
    return dict(only)


def variables(deployment: dict[str, Any]) -> dict[str, str]:
    (settings,) = objects("ConfigMap")
    own = {each["name"]: each["value"] for each in container(deployment)["env"]}
    return settings["data"] | SECRET | own


@each_deployment
def test_the_settings_are_valid(
    deployment: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    given = variables(deployment)
    assert given.keys() <= KNOWN
    for name in os.environ.keys() & KNOWN:
        monkeypatch.delenv(name)
    for name, value in given.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr("service.settings.available_cores", lambda: 4)
    settings = Settings()
    settings.check_shared()
    assert not settings.shares_data_dir
    pod = deployment["spec"]["template"]["spec"]
    stopping_s = settings.shutdown_delay_s + settings.shutdown_grace_s
    assert pod["terminationGracePeriodSeconds"] > stopping_s
    (data,) = (each for each in pod["volumes"] if each["name"] == "data")
    limit = int(data["emptyDir"]["sizeLimit"].removesuffix("Gi")) << 30
    assert settings.blob.cache_bytes + settings.min_free_disk_bytes < limit


@each_deployment
def test_the_command_exists_and_writes_to_volumes_alone(deployment: dict[str, Any]) -> None:
    script = container(deployment)["args"][-1]
    words = re.search(r"exec mpe (.+)", script)
    assert words is not None
    parsed = _parser().parse_args(words[1].split())
    (port,) = container(deployment)["ports"]
    assert parsed.port == port["containerPort"]
    assert container(deployment)["securityContext"]["readOnlyRootFilesystem"] is True
    mounted = {each["mountPath"] for each in container(deployment)["volumeMounts"]}
    assert mounted == {"/tmp", variables(deployment)["MPE_DATA_DIR"]}


@each_deployment
def test_probes_ask_for_what_is_answered(deployment: dict[str, Any]) -> None:
    for probe in ("startupProbe", "readinessProbe", "livenessProbe"):
        assert container(deployment)[probe]["httpGet"]["path"] in ("/readyz", "/livez")


@pytest.mark.parametrize("kind", ["PodDisruptionBudget", "Service", "HorizontalPodAutoscaler"])
def test_what_selects_pods_finds_some(kind: str) -> None:
    labels = [d["spec"]["template"]["metadata"]["labels"] for d in DEPLOYMENTS]
    names = [d["metadata"]["name"] for d in DEPLOYMENTS]
    for each in objects(kind):
        spec = each["spec"]
        if kind == "HorizontalPodAutoscaler":
            assert spec["scaleTargetRef"]["name"] in names
        else:
            selector = spec["selector"]
            wanted = selector.get("matchLabels", selector)
            assert any(wanted.items() <= of.items() for of in labels)


@pytest.mark.parametrize("path", sorted(PROJECT.glob("compose*.yaml")), ids=lambda path: path.name)
def test_compose_files_name_settings_and_commands_that_exist(path: Path) -> None:
    for name, service in yaml.safe_load(path.read_text())["services"].items():
        of_mpe = {v for v in service.get("environment", {}) if v.startswith("MPE_")}
        assert of_mpe <= KNOWN, name
        for words in re.findall(r"exec mpe (.+)", " ".join(map(str, service.get("command", [])))):
            _parser().parse_args(words.split())


def test_prometheus_asks_every_replica_that_compose_starts() -> None:
    compose = yaml.safe_load((PROJECT / "compose.cluster.yaml").read_text())
    (job,) = yaml.safe_load((MONITORING / "prometheus.yaml").read_text())["scrape_configs"]
    (by_name,) = job["dns_sd_configs"]
    of_mpe = {name for name, of in compose["services"].items() if of.get("image") == "mpe"}
    assert set(by_name["names"]) == of_mpe
    for name in of_mpe:
        assert f"--port {by_name['port']}" in compose["services"][name]["command"][-1]
    for config in compose["configs"].values():
        assert "content" in config or (PROJECT / config["file"]).is_file()
