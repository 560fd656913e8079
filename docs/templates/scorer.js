/* The order of what a search finds: pages before names of Python, and the changelog last. */
var Scorer = {
  score: ([page, , , , score]) => (page === "CHANGELOG" ? score - 100 : score),
  objNameMatch: 4,
  objPartialMatch: 0,
  objPrio: { 0: 0, 1: 0, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
