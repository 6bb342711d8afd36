// Debian's Chromium, headless, quiet on the network; with software GL, unless the graphics card is asked for.

import { chromium } from "playwright-core";

const EXECUTABLE = process.env.CHROMIUM ?? "/usr/bin/chromium";

export function launch(withGpu = false) {
  return chromium.launch({
    executablePath: EXECUTABLE,
    args: [
      ...(withGpu ? ["--use-gl=angle"] : ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"]),
      "--headless", "--no-sandbox", "--ignore-gpu-blocklist",
      "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update",
      "--disable-sync",
    ],
  });
}
