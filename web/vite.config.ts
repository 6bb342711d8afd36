import { defineConfig } from "vite";

// Everything lands in dist/ and from there in the Rust binary: no address but the server's own is ever asked.
export default defineConfig({
  base: "./",
  build: {
    rollupOptions: { input: ["index.html", "edit.html", "prepare.html"] },
    target: "es2022", chunkSizeWarningLimit: 1200, assetsInlineLimit: 0,
  },
});
