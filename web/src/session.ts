// Signing in and out, and the sites that it opens.

import { inWords, Refused, type Api } from "./api";
import type { Dispatch } from "./store";

/** Whether a failure is that the session has ended; the page then asks for a token again. */
export function hasEnded(error: unknown, dispatch: Dispatch): boolean {
  const ended = error instanceof Refused && error.status === 401;
  if (ended) dispatch({ kind: "session", session: { kind: "out", problem: "Your session has ended. Sign in again." } });
  return ended;
}

/** Signs in with a token and lists the sites. */
export async function signIn(api: Api, dispatch: Dispatch, token: string): Promise<void> {
  dispatch({ kind: "session", session: { kind: "signing-in" } });
  try {
    const who = await api.signIn(token);
    dispatch({ kind: "session", session: { kind: "in", who } });
  } catch (error) {
    const problem =
      error instanceof Refused && (error.status === 401 || error.status === 422)
        ? "The server does not know this token. Check that it was copied whole, and that it was not revoked."
        : inWords(error);
    dispatch({ kind: "session", session: { kind: "out", problem } });
    return;
  }
  await listSites(api, dispatch);
}

/** Goes on with the session that the browser still has, if it has one. */
export async function resume(api: Api, dispatch: Dispatch): Promise<void> {
  try {
    const who = await api.session();
    dispatch({ kind: "session", session: who === null ? { kind: "out", problem: null } : { kind: "in", who } });
    if (who !== null) await listSites(api, dispatch);
  } catch (error) {
    dispatch({ kind: "session", session: { kind: "unreachable", problem: inWords(error) } });
  }
}

/** Ends the session. */
export async function signOut(api: Api, dispatch: Dispatch): Promise<void> {
  try {
    await api.signOut();
    dispatch({ kind: "session", session: { kind: "out", problem: null } });
  } catch (error) {
    dispatch({ kind: "trouble", trouble: `You are still signed in. ${inWords(error)}` });
  }
}

/** Asks for the sites; the state then has a level, if there is one. */
export async function listSites(api: Api, dispatch: Dispatch): Promise<void> {
  try {
    dispatch({ kind: "sites", sites: await api.sites() });
  } catch (error) {
    if (!hasEnded(error, dispatch)) dispatch({ kind: "session", session: { kind: "unreachable", problem: inWords(error) } });
  }
}
