// Words for the names of keys and facts, whose last parts are units.
const UNITS = { mm: "mm", mm2: "mm²", cm3: "cm³", um: "µm", deg: "°", khz: "kHz", hz: "Hz", mg: "mg", g: "g", kg_m3: "kg/m³",
  m_s: "m/s", mm_s: "mm/s", HB: "HB", MPa: "MPa", GPa: "GPa", ms: "ms", s: "s", share: "%" };
const UNIT = new RegExp(`_(${Object.keys(UNITS).sort((a, b) => b.length - a.length).join("|")})(\\.[012])?$`);

export const unitOf = (name) => UNITS[UNIT.exec(name)?.[1]] ?? "";
// "sonotrode_distance_mm" is "Sonotrode distance"; symbols such as C0 stay.
export const inWords = (name) => name.replace(UNIT, "").replace(/\.[012]$/, "").replace("_pv", ", peak to valley").replace(/[_.]/g, " ")
  .replace(/^[a-z]{3}/, (first) => first[0].toUpperCase() + first.slice(1));
// "chamber.height_mm" is "Chamber height [mm]", and "part.offset_mm.0" "Part offset, x [mm]".
export function named(name) {
  const axis = /(?:deg|mm|axis)\.([012])$/.exec(name)?.[1], words = inWords(name.replace(/\./g, " ").replace(/ (?=[012]$)/, "."));
  return `${words}${axis ? `, ${"xyz"[axis]}` : ""}${unitOf(name) ? ` [${unitOf(name)}]` : ""}`;
}
// A fact with its unit: numbers to four digits, shares as per cent.
export function inUnits(name, fact) {
  const number = (x) => typeof x !== "number" ? String(x)
    : String(Number((unitOf(name) === "%" ? 100 * x : x).toPrecision(4)));
  const text = Array.isArray(fact) ? fact.map(number).join(", ") : number(fact);
  return unitOf(name) ? `${text} ${unitOf(name)}` : text;
}

// What choices are called on the page.
const CHOICES = { conformal: "conformal: follows the part", "": "none: the part hangs in the air", rod: "rod on a face", collar: "collar round an end or a shaft",
  plate: "plate on a face or round a root", arbor: "arbor: a shaft through a hole", bore: "the part itself, out through the wall", random_phase: "random phase" };
export const choiceInWords = (choice) => CHOICES[choice] ?? choice;

// What options of the command line are called on the page.
const OPTIONS = { target: "what is peened", unit: "the unit of the part", material: "alloy of the part", shot: "balls",
  shape: "form of the chamber", shop: "what your shop has", intensity: "Almen intensity", coverage: "coverage", "ball-mm": "ball diameter in mm",
  pose: "pose of the part", calibration: "calibration of the machine", "no-pilot": "the choice not to simulate" };
const TABLES = "part|chamber|shot|sonotrode|sonotrodes|materials|effects|process|holder|mask|zones|tolerances|ranges";
const KEY = new RegExp(`(?<![\\w./])(?:${TABLES})(?:\\.\\w+)+|--(?:${Object.keys(OPTIONS).join("|")})(?![\\w-])`, "g");
const FILE = /\.(?:toml|json|html|pdf|png|st[lp]|step|obj|ply|3mf|off|nas|bdf|dat|fem|inp|msh|data|vt[kpu]|vtkhdf)$/i; // no key

// A message of the program for the page: keys and options in words, with what they are in a file as a tip.
export function onPage(text) {
  const made = [];
  let at = 0;
  for (const { 0: found, index } of text.matchAll(KEY)) {
    if (FILE.test(found)) continue;
    const words = OPTIONS[found.slice(2)] ?? found.replace(/^effects\./, "").split(".").reverse()
      .map((step) => /^\d+$/.test(step) ? Number(step) + 1 : inWords(step).replace(/^[A-Z](?![A-Z0-9])/, (first) => first.toLowerCase())).join(" of the ");
    made.push(text.slice(at, index), Object.assign(document.createElement("abbr"), { textContent: words, title: found }));
    at = index + found.length;
  }
  return [...made, text.slice(at)];
}
