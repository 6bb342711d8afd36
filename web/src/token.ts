// The access token: from the address (behind the #, which is never sent), from this tab's memory, or asked for.

const KEY = "monro-token";

/** The token at hand, if any; it is taken out of the address bar so that it is not copied on by accident. */
export function tokenAtHand(): string | null {
  const fromAddress = new URLSearchParams(location.hash.slice(1)).get("token");
  if (fromAddress) {
    sessionStorage.setItem(KEY, fromAddress);
    history.replaceState(null, "", location.pathname + location.search);
  }
  return sessionStorage.getItem(KEY);
}

/** A token for a one-time pairing code; throws what the server says when the code is no good. */
async function redeem(code: string): Promise<string> {
  const headers = { "Content-Type": "application/json" };
  const response = await fetch("/api/pair", { method: "POST", headers, body: JSON.stringify({ code }) });
  const answer = (await response.json()) as { token?: string; error?: string };
  if (!answer.token) throw new Error(answer.error ?? "The pairing code was refused.");
  sessionStorage.setItem(KEY, answer.token);
  return answer.token;
}

/** The token for the pairing code in the address (from a QR code), if there is one that is good. */
export async function tokenByPairing(): Promise<string | null> {
  const code = new URLSearchParams(location.hash.slice(1)).get("pair");
  if (!code) return null;
  history.replaceState(null, "", location.pathname + location.search);
  return redeem(code).catch((error: Error) => askForToken(error.message));
}

/** Tokens are 32 digits long; whatever is shorter is a pairing code. */
async function tokenFor(typed: string): Promise<string> {
  if (typed.length >= 32) {
    sessionStorage.setItem(KEY, typed);
    return typed;
  }
  return redeem(typed).catch((error: Error) => askForToken(error.message));
}

/** Asks for a token or a pairing code, saying why. */
export function askForToken(why: string): Promise<string> {
  sessionStorage.removeItem(KEY);
  const dialog = document.querySelector<HTMLDialogElement>("#login");
  const input = document.querySelector<HTMLInputElement>("#login-token");
  const text = document.querySelector<HTMLElement>("#login-why");
  if (!dialog || !input || !text) throw new Error("The page has no login dialog.");
  text.textContent = why;
  dialog.showModal();
  return new Promise((resolve) => {
    dialog.onclose = () => {
      const typed = input.value.trim();
      // Closed without a word: nothing to ask the server.
      if (!typed) return dialog.showModal();
      input.value = "";
      resolve(tokenFor(typed));
    };
  });
}
