// Surfaces of the part that a button or a line names: shown in the view while it is pointed at or has the focus.
import { attempt, unpack } from "./state.js";

// `answer` gives what the server answers of the triangles of the surface that `named` names.
export function lights(named, view, answer, colour) {
  let isOn = false, found = null;
  const show = () => attempt(async () => {
    isOn = true;
    found ??= unpack(await answer()).triangles;
    if (isOn) view.highlight("part", found, colour());
  });
  const hide = () => {
    isOn = false;
    view.highlight("part", null);
  };
  for (const name of ["pointerenter", "focusin"]) named.addEventListener(name, show);
  for (const name of ["pointerleave", "focusout"]) named.addEventListener(name, hide);
  return named;
}
