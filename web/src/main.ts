// Start of the page: one document for every path, which chooses what is shown.
import "./style.css";
import { jobPage } from "./pages/job-page";
import { listPage } from "./pages/job-list";

const app = document.getElementById("app")!;
const job = /^\/v1\/jobs\/([^/]+)\/view\/?$/.exec(location.pathname);
let id = job?.[1] ?? "";
try {
  id = decodeURIComponent(id);
} catch {
  // a malformed address: the service answers that it has no such job
}
void (job ? jobPage(app, id) : listPage(app));
