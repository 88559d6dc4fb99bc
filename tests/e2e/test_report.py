"""Report and picture of a registration, over HTTP."""

from __future__ import annotations

from tests.factories.scans import arms, as_npy
from tests.factories.server import Server, registered


def test_report_and_picture(server: Server) -> None:
    cloud = arms(1, 5000)
    job = registered(server.client, as_npy(cloud), as_npy(cloud + 3), labels='{"part": "<b>"}')
    place = f"/v1/registrations/{job['id']}"
    answer = server.client.get(f"{place}/report?unit=mm&tolerance=0.5")
    assert answer.status_code == 200, answer.text
    assert answer.headers["Content-Type"] == "text/html; charset=utf-8"
    assert "style-src 'sha256-" in answer.headers["Content-Security-Policy"]
    assert answer.headers["Content-Disposition"].startswith("inline")
    for text in (job["id"], job["source"]["sha256"], "within 0.5 mm", "part: &lt;b&gt;"):
        assert text in answer.text
    known = {"If-None-Match": answer.headers["ETag"]}
    assert (
        server.client.get(f"{place}/report?unit=mm&tolerance=0.5", headers=known).status_code == 304
    )
    assert server.client.get(f"{place}/report?unit=m", headers=known).status_code == 200
    assert server.client.get(f"{place}/report?unit={'m' * 17}").status_code == 422
    picture = server.client.get(f"{place}/preview.png")
    assert picture.headers["Content-Type"] == "image/png"
    assert picture.content.startswith(b"\x89PNG")
    for what in ("report", "preview.png"):
        assert server.client.get(f"/v1/registrations/none/{what}").status_code == 404
