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
  },
  server: {
    // `npm run dev` against a running server.
    proxy: { "/api": process.env["MAPFOLD_URL"] ?? "http://127.0.0.1:7171" },
  },
  test: {
    environment: "node",
    include: ["test/*.test.ts"],
  },
});
