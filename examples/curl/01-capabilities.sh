#!/usr/bin/env bash
# What the service can do, and who the key belongs to.
. "$(dirname "$0")/common.sh"
call "$BASE/v1/capabilities"
