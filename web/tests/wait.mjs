// Waiting in tests: machines under load are slow, so waits are long, and short where they can be.

export const PATIENCE_MS = 120_000;

/** Asks `check` until it gives something true, and gives that back. */
export async function until(what, check, seconds = PATIENCE_MS / 1000) {
  const end = Date.now() + 1000 * seconds;
  let last;
  do {
    last = await check();
    if (last) return last;
    await new Promise((r) => setTimeout(r, 50));
  } while (Date.now() < end);
  throw new Error(`waited ${seconds} s for: ${what}`);
}
