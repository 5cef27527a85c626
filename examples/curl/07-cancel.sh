#!/usr/bin/env bash
# Cancel a job and let go of its files: 07-cancel.sh /v1/jobs/ID.
. "$(dirname "$0")/common.sh"
job=$(ask --request DELETE "$BASE$1?purge=true")
json .state <<<"$job"
