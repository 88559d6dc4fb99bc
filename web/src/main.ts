// The page: header, and one view for each address behind the #.
import { getKey } from "./api";
import { h } from "./dom";
import { makeKeyForm } from "./faces";
import { openJob } from "./job_page";
import { openList } from "./list_page";
import { makeSubmitForm } from "./submit";

const header = document.getElementById("header") as HTMLElement;
const main = document.getElementById("main") as HTMLElement;
let current = new AbortController();
let address = "";

function showHeader(): void {
  const key = h(
    "details",
    { className: "key-field" },
    h("summary", {}, getKey() ? "Key set" : "Key"),
    h("div", { className: "card" }, makeKeyForm("key")),
  );
  const link = (href: string, text: string): HTMLElement =>
    h("a", { href, "aria-current": location.hash === href || (!location.hash && href === "#/") ? "page" : null }, text);
  header.replaceChildren(
    h("a", { href: "#/", className: "brand" }, h("span", { className: "dot source" }), h("span", { className: "dot target" }), "Registration"),
    h("nav", { "aria-label": "Pages" }, link("#/", "New"), link("#/registrations", "All registrations"), h("a", { href: "docs/" }, "Documents"), key),
  );
}

function route(): void {
  current.abort();
  current = new AbortController();
  showHeader();
  const [, id] = /^#\/registrations\/([^/]+)$/.exec(location.hash) ?? [];
  if (id) void openJob(main, decodeURIComponent(id), current.signal);
  else if (location.hash === "#/registrations") void openList(main, current.signal);
  else showStart();
  if (address && address !== location.hash) main.focus({ preventScroll: true });
  if (address !== location.hash) scrollTo(0, 0);
  address = location.hash;
}

function showStart(): void {
  main.replaceChildren(
    h(
      "section",
      { className: "start" },
      h("h1", {}, "Align two point clouds"),
      h("p", { className: "lead" }, "Drop two scans of the same thing. You get the pose that lays one on the other, how far to trust it, and how far the surfaces are apart."),
      makeSubmitForm(),
    ),
  );
}

for (const name of ["dragover", "drop"]) addEventListener(name, (event) => event.preventDefault());
addEventListener("hashchange", route);
addEventListener("keychange", route);
route();
