// The access token: from the address (behind the #, which is never sent), from this tab's memory, or asked for.

const KEY = "monro-token";

/** The token at hand, if any; it is taken out of the address bar so that it is not copied on by accident. */
export function tokenAtHand(): string | null {
  const fromAddress = new URLSearchParams(location.hash.slice(1)).get("token");
  if (fromAddress) {
    sessionStorage.setItem(KEY, fromAddress);
    history.replaceState(null, "", location.pathname);
  }
  return sessionStorage.getItem(KEY);
}

/** Asks for a token, saying why. */
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
      const token = input.value.trim();
      sessionStorage.setItem(KEY, token);
      resolve(token);
    };
  });
}
