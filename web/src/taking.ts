// What the card of files asks of the server: what is in a model's file, and to take it into the draft.

import { inWords, isAborted, type Api } from "./api";
import { sendingOf, type FilesState, type FileTold } from "./model_files";
import type { Place } from "./permalink";
import { hasEnded } from "./session";
import { samePlace, type State } from "./state";
import type { Dispatch } from "./store";
import { zipped } from "./zip";

/** What the card can be told to do. */
export interface FileActions {
  open: (open: boolean) => void;
  /** Other files are chosen, or they are to be taken in another way. */
  choose: (choice: Partial<Pick<FilesState, "replace" | "level" | "unit">>) => void;
  /** Asks what is in them. */
  tryOut: (files: readonly File[]) => void;
  /** Takes them in. */
  confirm: (files: readonly File[]) => void;
}

export interface FileActionsOptions {
  api: Api;
  state: () => State;
  dispatch: Dispatch;
  /** The draft has changed. */
  onTaken: () => void;
}

export function createFileActions({ api, state, dispatch, onTaken }: FileActionsOptions): FileActions {
  let asking = new AbortController();
  const change = (files: Partial<FilesState>): void => {
    dispatch({ kind: "files", files });
  };

  const send = async (files: readonly File[], preview: boolean, busy: string, said: (told: FileTold) => Partial<FilesState>): Promise<void> => {
    const { place, files: chosen } = state();
    const names = files.map(({ name }) => name);
    const sending = sendingOf(names, chosen);
    if (place === null || sending === null) return;
    asking.abort();
    const own = new AbortController();
    asking = own;
    const isStill = (there: Place): boolean => !own.signal.aborted && samePlace(there, state().place);
    change({ busy, problem: null, done: null });
    try {
      const bytes = async (file: File): Promise<Uint8Array<ArrayBuffer>> => new Uint8Array(await file.arrayBuffer());
      const [first] = files;
      if (first === undefined) return;
      const body = sending.zipped
        ? await zipped(await Promise.all(files.map(async (file) => ({ name: file.name, bytes: await bytes(file) }))))
        : new Blob([await bytes(first)]);
      const query = { ...sending.query, preview: String(preview), replace: String(chosen.replace) };
      // What is not asked for only, is not given up halfway.
      const told = await api.takeModel(place, { body, mediaType: sending.mediaType, query }, preview ? own.signal : null);
      if (isStill(place)) change({ busy: null, ...said(told) });
      if (!preview) onTaken();
    } catch (error) {
      if (isStill(place) && !isAborted(error) && !hasEnded(error, dispatch)) change({ busy: null, problem: inWords(error) });
    }
  };

  return {
    open: (open) => {
      if (open !== state().files.open) change({ open });
    },
    choose: (choice) => {
      asking.abort();
      change({ told: null, busy: null, problem: null, done: null, ...choice });
    },
    tryOut: (files) => void send(files, true, "Reading the file …", (told) => ({ told })),
    confirm: (files) =>
      void send(files, false, "Taking it in …", ({ answer }) => ({
        told: null,
        done: answer?.entry == null ? "The draft had all of it already." : `It is in the draft, at revision ${answer.entry.revision}.`,
      })),
  };
}
