// One document for every path of the page; the path says what is shown.
import "./style.css";
import { jobPage } from "./jobpage";
import { listPage } from "./listpage";

const app = document.getElementById("app")!;
const job = /^\/v1\/jobs\/([^/]+)\/view\/?$/.exec(location.pathname);
void (job ? jobPage(app, decodeURIComponent(job[1]!)) : listPage(app));
