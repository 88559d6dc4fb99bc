// Bundles src/ into the folder that the service serves: index.html, and assets with hashes in their names.
import { build } from "esbuild";
import { mkdir, readFile, rm, writeFile } from "node:fs/promises";
import { basename, join } from "node:path";

const out = process.argv[2];
await rm(out, { recursive: true, force: true });
await mkdir(join(out, "assets"), { recursive: true });
const { metafile } = await build({
  entryPoints: ["src/main.ts", "src/style.css"],
  outdir: join(out, "assets"),
  entryNames: "[name]-[hash]",
  bundle: true,
  minify: true,
  format: "esm",
  target: ["es2022"],
  legalComments: "none",
  metafile: true,
  logLevel: "warning",
});
let html = await readFile("src/index.html", "utf8");
for (const [path, { entryPoint }] of Object.entries(metafile.outputs)) {
  html = html.replace(basename(entryPoint), `assets/${basename(path)}`);
}
const licence = await readFile("node_modules/three/LICENSE", "utf8");
await writeFile(join(out, "assets", "licences.txt"), `three.js\n\n${licence}`);
await writeFile(join(out, "index.html"), html);
