// Post a part with a setup built from typed classes, wait for the end, fetch the programs:
// run-job PART.step OUT; ZONEMILL_BASE and ZONEMILL_KEY as for the curl scripts.
package main

import (
	"bytes"
	"context"
	"encoding/json"
	"fmt"
	"log"
	"mime/multipart"
	"net/http"
	"net/textproto"
	"os"
	"path/filepath"
	"strings"
	"time"

	"runjob/zonemill"
)

func pointer[T any](value T) *T { return &value }

func setup() zonemill.Setup {
	var tool zonemill.Setup_Tools_Item
	if err := tool.FromTool(zonemill.Tool{
		Id: "T1", Kind: "flat", DiameterMm: 4, FluteLengthMm: pointer(8.0), StickoutMm: pointer(20.0),
	}); err != nil {
		log.Fatal(err)
	}
	return zonemill.Setup{
		Tools:   []zonemill.Setup_Tools_Item{tool},
		Quality: &zonemill.Quality{ScallopHeightMm: pointer(0.05)},
		Stock:   &zonemill.Stock{MarginMm: pointer(0.5), UncertaintyMm: pointer(0.0)},
		Labels:  &map[string]interface{}{"client": "go"},
	}
}

// form writes the parts that POST /v1/jobs reads; the setup is JSON.
func form(part string) (string, *bytes.Buffer) {
	body := &bytes.Buffer{}
	writer := multipart.NewWriter(body)
	step, err := os.ReadFile(part)
	check(err)
	file, err := writer.CreateFormFile("part", filepath.Base(part))
	check(err)
	_, err = file.Write(step)
	check(err)
	header := textproto.MIMEHeader{}
	header.Set("Content-Disposition", `form-data; name="setup"`)
	header.Set("Content-Type", "application/json")
	field, err := writer.CreatePart(header)
	check(err)
	check(json.NewEncoder(field).Encode(setup()))
	check(writer.Close())
	return writer.FormDataContentType(), body
}

func check(err error) {
	if err != nil {
		log.Fatal(err)
	}
}

func main() {
	base, key := os.Getenv("ZONEMILL_BASE"), os.Getenv("ZONEMILL_KEY")
	if base == "" {
		base = "http://127.0.0.1:8000"
	}
	show := zonemill.WithRequestEditorFn(func(_ context.Context, request *http.Request) error {
		if key != "" {
			request.Header.Set("Authorization", "Bearer "+key)
		}
		return nil
	})
	client, err := zonemill.NewClientWithResponses(base, show)
	check(err)
	ctx := context.Background()
	kind, body := form(os.Args[1])
	posted, err := client.CreateJobWithBodyWithResponse(ctx, &zonemill.CreateJobParams{
		IdempotencyKey: pointer("client-go")}, kind, body)
	check(err)
	if posted.JSON202 == nil {
		log.Fatalf("%s: %s", posted.Status(), posted.Body)
	}
	job := *posted.JSON202
	for job.State == "queued" || job.State == "running" {
		time.Sleep(500 * time.Millisecond)
		answer, err := client.GetJobWithResponse(ctx, job.Id)
		check(err)
		if answer.JSON200 == nil {
			log.Fatalf("%s: %s", answer.Status(), answer.Body)
		}
		job = *answer.JSON200
	}
	files, err := client.ListFilesWithResponse(ctx, job.Id)
	check(err)
	programs := 0
	for _, file := range files.JSON200.Items {
		if !strings.HasPrefix(file.Name, "program.") {
			continue
		}
		got, err := client.GetFileWithResponse(ctx, job.Id, file.Name)
		check(err)
		check(os.WriteFile(filepath.Join(os.Args[2], file.Name), got.Body, 0o644))
		programs++
	}
	fmt.Printf("%s, coverage %.4f, %d programs\n", job.State, *job.Summary.Coverage, programs)
}
