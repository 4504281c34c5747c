import { readFileSync, readdirSync, existsSync } from "node:fs";
import { dirname, join } from "node:path";
import react from "@vitejs/plugin-react";
import { defineConfig, type Plugin } from "vite";

/** The nearest package.json above a module that has a name: the package that the module comes from. */
function packageOf(module: string): string | null {
  for (let folder = dirname(module); folder.includes("node_modules"); folder = dirname(folder)) {
    const file = join(folder, "package.json");
    if (existsSync(file) && JSON.parse(readFileSync(file, "utf8")).version) return folder;
  }
  return null;
}

/** LICENSES.txt: the packages of which anything is in the bundle, by name, each with its licence in full. */
function licences(): Plugin {
  return {
    name: "licences",
    generateBundle(_, bundle) {
      const folders = new Set<string>();
      for (const part of Object.values(bundle)) {
        if (part.type !== "chunk") continue;
        for (const module of part.moduleIds) {
          const folder = module.includes("node_modules") ? packageOf(module.replace(/^\0/, "").split("?")[0]!) : null;
          if (folder) folders.add(folder);
        }
      }
      folders.add(join(import.meta.dirname, "node_modules/@mantine/core")); // its style sheets have no module
      const texts = [...folders].map((folder) => {
        const about = JSON.parse(readFileSync(join(folder, "package.json"), "utf8"));
        const file = readdirSync(folder).sort().find((name) => /^(licen[cs]e|copying)/i.test(name));
        const text = file ? readFileSync(join(folder, file), "utf8").trim() : "(no text of its own in the package)";
        return `${about.name} ${about.version}: ${about.license}\n\n${text.replace(/\r/g, "")}\n`;
      });
      const source = `Packages in this bundle, and their licences.\n\n${[...new Set(texts)].sort().join(`\n${"-".repeat(80)}\n\n`)}`;
      this.emitFile({ type: "asset", fileName: "LICENSES.txt", source });
    },
  };
}

export default defineConfig({
  plugins: [react(), licences()],
  base: "/",
  build: {
    outDir: "../bundle",
    emptyOutDir: true,
    target: "es2022",
    modulePreload: { polyfill: false },
    assetsInlineLimit: 0,
    reportCompressedSize: false,
    chunkSizeWarningLimit: 1200,
  },
  server: { proxy: { "/api": "http://127.0.0.1:8642" } },
});
