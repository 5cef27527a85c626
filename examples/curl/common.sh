# What every script begins with: where the service is, and the key if it wants one. Sourced, not run.
set -euo pipefail
BASE=${ZONEMILL_BASE:-http://127.0.0.1:8000}
AUTH=()
if [ -n "${ZONEMILL_KEY:-}" ]; then AUTH=(-H "Authorization: Bearer $ZONEMILL_KEY"); fi

# One request; an answer of 4xx or 5xx is printed and ends the script with 22.
call() { curl --silent --show-error --fail-with-body --noproxy '*' "${AUTH[@]}" "$@"; }

# The same for small answers: what went wrong goes to stderr.
ask() {
  local text code=0
  text=$(call "$@") || code=$?
  if [ "$code" != 0 ]; then echo "$text" >&2; return "$code"; fi
  echo "$text"
}

# Field of a JSON object on stdin: json .links.self
json() { python3 -c 'import json, sys
value = json.load(sys.stdin)
for name in sys.argv[1].strip(".").split("."):
    value = value[int(name)] if isinstance(value, list) else value[name]
print(value)' "$1"; }
