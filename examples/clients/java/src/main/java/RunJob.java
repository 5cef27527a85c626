import java.io.File;
import java.math.BigDecimal;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.List;
import java.util.Locale;
import java.util.Map;
import zonemill.ApiClient;
import zonemill.api.JobsApi;
import zonemill.api.SubmissionsApi;
import zonemill.model.Job;
import zonemill.model.JobFile;
import zonemill.model.Quality;
import zonemill.model.Setup;
import zonemill.model.Stock;
import zonemill.model.Tool;
import zonemill.model.ToolsInner;

/**
 * Posts a part with a setup built from typed classes, waits for the end, fetches the programs:
 * RunJob PART.step OUT; ZONEMILL_BASE and ZONEMILL_KEY as for the curl scripts.
 */
public final class RunJob {
    private static Setup setup() {
        Tool tool = new Tool().id("T1").kind(Tool.KindEnum.FLAT).diameterMm(4.0).fluteLengthMm(8.0).stickoutMm(20.0);
        return new Setup()
            .tools(List.of(new ToolsInner(tool)))
            .access(null) // the generated class would send an empty list, and a setup has one access at least
            .quality(new Quality().scallopHeightMm(0.05))
            .stock(new Stock().marginMm(0.5).uncertaintyMm(0.0))
            .labels(Map.of("client", "java"));
    }

    public static void main(String[] words) throws Exception {
        String base = System.getenv().getOrDefault("ZONEMILL_BASE", "http://127.0.0.1:8000");
        String key = System.getenv().getOrDefault("ZONEMILL_KEY", "");
        ApiClient client = new ApiClient().setBasePath(base);
        if (!key.isEmpty()) {
            client.addDefaultHeader("Authorization", "Bearer " + key);
        }
        JobsApi jobs = new JobsApi(client);
        Job job = new SubmissionsApi(client).createJob(new File(words[0]), setup(), "client-java", null, null, null);
        while (job.getState() == Job.StateEnum.QUEUED || job.getState() == Job.StateEnum.RUNNING) {
            Thread.sleep(500);
            job = jobs.getJob(job.getId());
        }
        int programs = 0;
        for (JobFile file : jobs.listFiles(job.getId()).getItems()) {
            if (file.getName().startsWith("program.")) {
                File got = jobs.getFile(job.getId(), file.getName());
                Files.copy(got.toPath(), Path.of(words[1], file.getName()));
                programs++;
            }
        }
        double coverage = job.getSummary().getCoverage();
        System.out.println(String.format(Locale.ROOT, "%s, coverage %.4f, %d programs",
            job.getState(), coverage, programs));
        System.exit(0); // the connection pool's threads would keep it alive for a minute
    }
}
