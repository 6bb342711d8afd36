// How live, stale and lost look and read, wherever they are shown.

export const SHAPES = {
  live: "M12 2a10 10 0 1 0 0 20 10 10 0 0 0 0-20z",
  stale: "M12 2 23 21H1z",
  lost: "M5 2 2 5l7 7-7 7 3 3 7-7 7 7 3-3-7-7 7-7-3-3-7 7z",
} as const;
export const WORDS = { live: "Live", stale: "Stale", lost: "Lost" } as const;
/** As in style.css. */
export const STATE_COLOURS = { live: "#56b4e9", stale: "#f0e442", lost: "#ff6b4a" } as const;
