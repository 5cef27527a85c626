#!/usr/bin/env bash
# Prove a program: 09-verify.sh PART.step SETUP.json PROGRAM; prints the report, ends with 3 where there are findings.
. "$(dirname "$0")/common.sh"
answer=$(ask -F "part=@$1" -F "setup=@$2;type=application/json" -F "program=@$3" -F deadline_s=3600 \
         "$BASE/v1/verifications")
job=$(json .links.self <<<"$answer")
call --no-buffer "$BASE$job/events" >/dev/null
call "$BASE$job/report"
answer=$(ask "$BASE$job")
[ "$(json .state <<<"$answer")" = proved ] || exit 3
