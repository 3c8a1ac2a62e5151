// Code, tables and pictures that are wider than the page can be scrolled with the keyboard too.
function reachable() {
  for (const part of document.querySelectorAll("article pre, article table.docutils, article p:has(> img), article .cell_output:has(> img)")) {
    if (part.scrollWidth > part.clientWidth) part.tabIndex = 0;
    else part.removeAttribute("tabindex");
  }
}
addEventListener("load", reachable);
addEventListener("resize", reachable);
addEventListener("toggle", reachable, true);
