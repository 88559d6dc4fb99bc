"""All kinds of requests of an honest client."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from dataclasses import dataclass

import httpx

from tests.e2e.attacks.traps import Traps
from tests.e2e.soak.record import LATER, Record
from tests.factories.scans import arms, as_npy
from tests.factories.server import submit

JOBS, CLOUDS, UPLOADS = "/v1/registrations", "/v1/clouds", "/v1/uploads"
TUS = {"Tus-Resumable": "1.0.0"}
PARTS = (
    *("", "/events", "/deliveries", "/inliers", "/inliers?format=npy"),
    *("/aligned?format=laz", "/aligned?distances=true", "/preview?role=source", "/preview.png"),
    *("/deviation?tolerance=0.1", "/report?unit=mm"),
)
DOCUMENTS = (
    *("/", "/livez", "/readyz", "/metrics", "/openapi.json", "/v1/capacity", "/v1/formats"),
    *(f"{JOBS}?limit=20", f"{JOBS}?status=succeeded", f"{CLOUDS}?limit=20"),
)
MAX_REST = 2.0
"""Longest pause after a refusal, as a multiple of the one it asks for: not all return at once."""
MIN_KEPT = 5
"""Jobs that a tenant keeps at least."""
CLOUD_NAMES = ("a", "b", "c")


@dataclass(frozen=True, slots=True)
class Honest:
    """One client of one tenant."""

    tenant: str
    client: httpx.Client
    traps: Traps
    record: Record
    rng: random.Random

    def act(self) -> None:
        """Send a request, or a few that belong together."""
        kinds: dict[Callable[[], None], int] = {
            self.submit_files: 20,
            self.submit_stored: 5,
            self.submit_urls: 5,
            self.repeat_key: 5,
            self.store_cloud: 10,
            self.upload_in_pieces: 5,
            self.look_at_own: 30,
            self.ask_again_for_known: 5,
            self.look_at_strange: 10,
            self.read_documents: 5,
            self.check_list: 4,
            self.delete_own: 1,
        }
        act = self.rng.choices(list(kinds), list(kinds.values()))[0]
        self.record.done[act.__name__] += 1
        act()

    def rest(self, response: httpx.Response) -> None:
        """Wait after a refusal for as long as it asks for, or some time more."""
        asked_s = float(response.headers.get("Retry-After", 0))
        if response.is_error and asked_s:
            self.record.rests += 1
            self.record.is_over.wait(asked_s * self.rng.uniform(1, MAX_REST))

    def submit_files(self) -> None:
        """Two files in a form; sometimes with a wait or a callback."""
        fields = {"callback_url": self.traps.hook} if self.rng.random() < 0.2 else {}
        cloud = as_npy(arms(self.rng.randrange(20)))
        wait = self.rng.choice((0, 1))
        self._keep(submit(self.client, cloud, cloud, wait=wait, **self._form(), **fields))

    def submit_stored(self) -> None:
        """Two stored clouds, in JSON."""
        name = self.rng.choice(CLOUD_NAMES)
        answer = self._post_json({"cloud": name})
        if answer.status_code != 404:  # nobody has stored it yet
            self._keep(answer)

    def submit_urls(self) -> None:
        """Two URLs, in JSON."""
        self._keep(self._post_json({"url": self.traps.cloud}))

    def repeat_key(self) -> None:
        """The same request twice under one key: it is one job."""
        cloud, form = as_npy(arms(1)), self._form()
        headers = {"Idempotency-Key": f"{self.tenant}-{self.rng.random()}"}
        found = set()
        for _ in range(2):
            answer = submit(self.client, cloud, cloud, headers=headers, **form)
            self._keep(answer)
            if answer.is_success:
                found.add(answer.json()["id"])
        if len(found) > 1:
            self.record.faults.append("one key was accepted as two jobs")

    def store_cloud(self) -> None:
        """Store a cloud, look at it, sometimes delete it."""
        path = f"{CLOUDS}/{self.rng.choice(CLOUD_NAMES)}"
        self._call("PUT", path, content=as_npy(arms(self.rng.randrange(4))))
        self._call("GET", path)
        if self.rng.random() < 0.1:
            self._call("DELETE", path)

    def upload_in_pieces(self) -> None:
        """A cloud in two pieces, by tus."""
        cloud = as_npy(arms(self.rng.randrange(4)))
        created = self._call("POST", UPLOADS, headers=TUS | {"Upload-Length": str(len(cloud))})
        place, half = created.headers.get("Location"), len(cloud) // 2
        if place is None:
            return
        for offset, piece in ((0, cloud[:half]), (half, cloud[half:])):
            headers = {
                "Upload-Offset": str(offset),
                "Content-Type": "application/offset+octet-stream",
            }
            self._call("PATCH", place, content=piece, headers=TUS | headers)
            self._call("HEAD", place, headers=TUS)

    def look_at_own(self) -> None:
        """A registration, or what can be asked about it."""
        jobs = self.record.jobs_of(self.tenant)
        if not jobs:
            return
        job = self.rng.choice(jobs)
        path = f"{JOBS}/{job}{self.rng.choice(PARTS)}"
        with self.client.stream("GET", path) as response:
            if response.headers.get("content-type", "").startswith("text/event-stream"):
                next(response.iter_lines(), None)  # it goes on until the job ends
            else:
                response.read()
        if "text/event-stream" not in response.headers.get("content-type", ""):
            self.record.note(response)
        if response.status_code == 404 and job in self.record.accepted:
            self.record.faults.append(f"{path} of an accepted job is 404")

    def ask_again_for_known(self) -> None:
        """What the caller has already is not sent again, whoever else asks."""
        jobs = self.record.jobs_of(self.tenant)
        if jobs:
            path = f"{JOBS}/{self.rng.choice(jobs)}/preview?role=target"
            tag = self._call("GET", path).headers.get("ETag")
            if tag:
                self._call("GET", path, headers={"If-None-Match": tag})
                self._call("HEAD", path)
                self._call("GET", path, headers={"Range": "bytes=0-47"})

    def look_at_strange(self) -> None:
        """What belongs to another tenant is answered like what does not exist."""
        jobs = self.record.jobs_of_others(self.tenant)
        if not jobs:
            return
        path = f"{JOBS}/{self.rng.choice(jobs)}"
        method, part = self.rng.choice(
            [("DELETE", ""), ("POST", "/deliveries"), *(("GET", part) for part in PARTS)]
        )
        answer = self._call(method, path + part)
        if answer.status_code not in (404, *LATER):
            self.record.faults.append(
                f"{method} {part} of another tenant's job was answered {answer.status_code}"
            )

    def read_documents(self) -> None:
        """What is the same for everybody, and lists."""
        for path in DOCUMENTS:
            self._call("GET", path)

    def check_list(self) -> None:
        """A list shows jobs of its own tenant alone."""
        answer = self._call("GET", f"{JOBS}?limit=50")
        if answer.is_success:
            for job in answer.json()["items"]:
                if job["labels"].get("tenant", self.tenant) != self.tenant:
                    self.record.faults.append("a list shows a job of another tenant")

    def delete_own(self) -> None:
        """Cancel or delete a job."""
        jobs = self.record.jobs_of(self.tenant)
        if len(jobs) > MIN_KEPT:
            job = self.rng.choice(jobs)
            self.record.accepted.pop(job, None)  # the answer may be lost
            self._call("DELETE", f"{JOBS}/{job}")

    def _form(self) -> dict[str, str]:
        options = json.dumps({"seed": self.rng.randrange(10**6)})
        return {"options": options, "labels": json.dumps({"tenant": self.tenant})}

    def _post_json(self, cloud: dict[str, str]) -> httpx.Response:
        wanted = {name: json.loads(text) for name, text in self._form().items()}
        return self.client.post(JOBS, json={"source": cloud, "target": cloud, **wanted})

    def _keep(self, response: httpx.Response) -> None:
        self.record.note(response)
        if response.is_success:
            self.record.accepted[response.json()["id"]] = self.tenant

    def _call(self, method: str, path: str, **sent: object) -> httpx.Response:
        response = self.client.request(method, path, **sent)  # type: ignore[arg-type]
        self.record.note(response)
        return response
