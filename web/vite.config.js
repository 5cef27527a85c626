import { defineConfig } from "vite";

// Everything is a file of its own: the service forbids inline scripts, styles and data of other hosts.
export default defineConfig({
  build: {
    outDir: "../service/page",
    emptyOutDir: true,
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    sourcemap: false,
    target: "es2022",
    chunkSizeWarningLimit: 900,
    license: { fileName: "assets/licenses.txt" },
  },
  server: { proxy: { "/v1/": "http://127.0.0.1:8000" } },
});
