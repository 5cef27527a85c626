// One document for every path of the page; the path says what is shown.
import "./style.css";
import { jobPage } from "./pages/job-page";
import { listPage } from "./pages/job-list";

const app = document.getElementById("app")!;
const job = /^\/v1\/jobs\/([^/]+)\/view\/?$/.exec(location.pathname);
let id = job?.[1] ?? "";
try {
  id = decodeURIComponent(id);
} catch {
  // an address that is none: the service has no job of that name, and says so
}
void (job ? jobPage(app, id) : listPage(app));
