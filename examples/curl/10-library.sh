#!/usr/bin/env bash
# Write a tool into the library: 10-library.sh NAME TOOL.json; prints what a setup says for this very version.
. "$(dirname "$0")/common.sh"
answer=$(ask --request PUT -H 'Content-Type: application/json' --data "@$2" "$BASE/v1/tools/$1")
echo "lib:$1@$(json .version <<<"$answer")"
