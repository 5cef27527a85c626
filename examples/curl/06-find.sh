#!/usr/bin/env bash
# Jobs by a label: 06-find.sh order:4711; one line each, newest first, page by page.
. "$(dirname "$0")/common.sh"
cursor=
while :; do
  page=$(ask --get --data-urlencode "label=$1" --data "limit=100" ${cursor:+--data-urlencode "cursor=$cursor"} "$BASE/v1/jobs")
  python3 -c 'import json, sys
for job in json.loads(sys.argv[1])["items"]:
    print(job["id"], job["state"], job["created_at"], sep="\t")' "$page"
  cursor=$(json .next_cursor <<<"$page")
  [ "$cursor" = None ] && break
done
