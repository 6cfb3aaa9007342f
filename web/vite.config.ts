// How the page is built: hashed files under dist/, nothing inlined (the server's
// Content-Security-Policy allows neither inline scripts nor foreign hosts).
import { defineConfig } from "vitest/config";

export default defineConfig({
  build: {
    target: "es2022",
    outDir: "dist",
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    reportCompressedSize: true,
    // three.js, which is loaded when the view in space is asked for.
    chunkSizeWarningLimit: 600,
  },
  server: {
    // `npm run dev` against a running server.
    proxy: { "/api": process.env["MAPFOLD_URL"] ?? "http://127.0.0.1:7171" },
  },
  test: {
    projects: [
      { test: { name: "unit", environment: "node", include: ["test/*.test.ts"] } },
      // Needs `dist/` and Chromium; one at a time, as rendering without a GPU takes a processor each.
      {
        test: {
          name: "browser",
          environment: "node",
          include: ["test/browser/*.test.ts"],
          fileParallelism: false,
          testTimeout: 60_000,
          hookTimeout: 60_000,
        },
      },
    ],
  },
});
