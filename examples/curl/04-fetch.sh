#!/usr/bin/env bash
# Fetch every file of a job into a folder: 04-fetch.sh /v1/jobs/ID FOLDER. What is there in part goes on where it broke
# off, and each file is held against its SHA-256.
. "$(dirname "$0")/common.sh"
mkdir -p "$2"
files=$(ask "$BASE$1/files")
python3 -c 'import json, sys
for item in json.loads(sys.argv[1])["items"]:
    print(item["sha256"], item["name"], item["href"])' "$files" | while read -r sha name href; do
  if ! echo "$sha  $2/$name" | sha256sum --check --status 2>/dev/null; then
    call --continue-at - --output "$2/$name" "$BASE$href" || { rm -f "$2/$name"; call --output "$2/$name" "$BASE$href"; }
    echo "$sha  $2/$name" | sha256sum --check --quiet
  fi
  echo "$2/$name"
done
