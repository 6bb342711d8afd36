// Lets another device in: a one-time code for a viewer or an operator.

import type { Api, Role } from "./api";
import { element, make, write } from "./dom";

/** Only an operator can, and only where others can reach the server. */
export function offerInvitations(api: Api, role: Role | null): void {
  const parent = element("#invite");
  parent.hidden = role !== "operator" || location.protocol !== "https:";
  const said = make("output");
  for (const wanted of ["viewer", "operator"] satisfies Role[]) {
    const button = make("button", { textContent: `As ${wanted}` });
    button.onclick = () =>
      void api.invite(wanted).then(
        ({ code, seconds }) => write(said, `${code}, good once at ${location.origin} for ${Math.round(seconds / 60)} minutes`),
        (error: unknown) => write(said, error instanceof Error ? error.message : String(error)),
      );
    parent.append(button);
  }
  parent.append(said);
}
