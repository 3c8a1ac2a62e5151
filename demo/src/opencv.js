// A script of its own, loaded when photographs come: it is four times as large as the rest of the page.
export { loadOpenCV } from "@opencvjs/web";
