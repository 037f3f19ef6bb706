#!/usr/bin/env bash
# Who may include whom; see CONTRIBUTING.md. Prints every include that crosses a line.
set -uo pipefail
cd "$1"
status=0

# forbid FOLDER PATTERN [EXCEPT]: no file under FOLDER may include what matches PATTERN but not EXCEPT.
forbid() {
  local found
  found=$(grep -rnE --include='*.h' --include='*.cpp' "#include +[<\"]($2)" "$1" | grep -vE "${3:-^$}")
  if [ -n "$found" ]; then
    echo "$found"
    status=1
  fi
}

forbid estimator '(app|rig|storage)/'
forbid estimator '(fmt|spdlog|nlohmann|CLI|sqlite3|modbus|fstream|filesystem|toml)'
forbid rig '(app|storage)/'
forbid rig 'estimator/' 'estimator/measurement\.h'
forbid storage '(app|rig)/'
forbid storage 'estimator/' 'estimator/measurement\.h'
[ $status -eq 0 ] && echo "includes: every folder sees only what it may see"
exit $status
