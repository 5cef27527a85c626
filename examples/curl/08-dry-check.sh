#!/usr/bin/env bash
# What can be reached, and what tool to buy: 08-dry-check.sh PART.step SETUP.json; prints zones.json.
. "$(dirname "$0")/common.sh"
answer=$(ask -F "part=@$1" -F "setup=@$2;type=application/json" "$BASE/v1/zones")
job=$(json .links.self <<<"$answer")
call --no-buffer "$BASE$job/events" >/dev/null
call "$BASE$job/zones"
