#!/usr/bin/env bash
# Post a job: 02-post.sh PART.step SETUP.json [KEY]; prints its path. The same key with the same content posts it once.
. "$(dirname "$0")/common.sh"
answer=$(ask -H "Idempotency-Key: ${3:-$(sha256sum "$1" "$2" | sha256sum | cut -c1-40)}" \
     -F "part=@$1" -F "setup=@$2;type=application/json" "$BASE/v1/jobs")
json .links.self <<<"$answer"
