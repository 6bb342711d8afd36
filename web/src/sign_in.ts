// Signing in: the first question decides whether the token is right.

import { Api, Unauthorized } from "./api";
import { askForToken, tokenAtHand, tokenByPairing } from "./token";

/** Asks for tokens until one is right; the API with it, and the answer to the first question. */
export async function signIn<T>(ask: (api: Api) => Promise<T>): Promise<{ api: Api; first: T }> {
  let token = (await tokenByPairing()) ?? tokenAtHand() ?? (await askForToken("Open this page with the address that Monro printed, or enter its token."));
  for (;;) {
    try {
      const api = new Api(token);
      return { api, first: await ask(api) };
    } catch (error) {
      if (!(error instanceof Unauthorized)) throw error;
      token = await askForToken(error.message);
    }
  }
}
