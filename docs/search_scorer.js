// How the search of the site ranks what it finds. The numbers are Sphinx's own; keywords of pages
// (see site_search.py) count up to 100. Of pages that only contain the words, those for users come first.
var Scorer = {
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
  score: ([page, title, anchor, about, score, file, kind]) => {
    if (kind !== "text") return score;
    if (/^(changelog|architecture|contributing|development|measurements)$/.test(page)) return score - 4;
    if (/^(api$|api\/|how-to$|i-want-to$|names$|gallery$)/.test(page)) return score - 3;
    return page.startsWith("models/") ? score - 1 : score;
  },
};
