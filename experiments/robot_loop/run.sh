#!/bin/sh
# The paper's loop with a robot in a process of its own: execute, learn, compile, execute again.
#
#   experiments/robot_loop/run.sh [WORK [FIGURES]]
#
# WORK (out/robot_loop) gets a log, a learned feedforward and a controller for each execution,
# FIGURES (WORK) the figure, robot_loop.png/.pdf, and its numbers, robot_loop.json/.md.
# An interrupted run goes on where it was.
#
# Set PYTHON to an interpreter that has jaxidl, CC to a C compiler. MODE is real (1 kHz by the
# clock; needs the right to real-time priority) or lock-step (each tick waits for its command).
# MORE=no leaves out faults and gap finder.
set -eu

work=${1:-out/robot_loop}
figures=${2:-$work}
here=$(cd "$(dirname "$0")" && pwd)
PYTHON=${PYTHON:-python3}
CC=${CC:-cc}
EXECUTIONS=${EXECUTIONS:-10}
LEARN=${LEARN:---source weighted --guard --layers 64 32 1 --epochs 12} # small: minutes
MORE=${MORE:-yes}
PRIORITY=50

# ---- what is needed, before anything is begun
stop() { echo "run.sh: expected $1; got $2; $3" >&2; exit 2; }
command -v "$CC" >/dev/null 2>&1 || stop "a C compiler" "no $CC on the path" "install gcc or clang, or set CC"
"$PYTHON" -c "import jaxidl" 2>/dev/null || stop "a Python with jaxidl" "none in $PYTHON" "set PYTHON"
can_hurry() { chrt -f $PRIORITY true 2>/dev/null; }
MODE=${MODE:-$(can_hurry && echo real || echo lock-step)}
case $MODE in
    real)
        can_hurry || stop "the right to real-time priority" "none" "set MODE=lock-step, or raise ulimit -r"
        options="--priority $PRIORITY" ;;
    lock-step) options=--lock-step ;;
    *) stop "MODE real or lock-step" "$MODE" "correct it" ;;
esac
echo "run.sh: $EXECUTIONS executions in $work, $MODE"

# ---- the controller of one execution from the arm.c in a folder
build() {
    "$CC" -std=c99 -O2 -I"$1" -I"$work" -I"$here" "$here/controller.c" "$1/arm.c" -lm -o "$1/controller"
}

# ---- one execution; a log gets its name when the task came to its end
execute() {
    for try in 1 2 3; do
        # $options are words
        # shellcheck disable=SC2086
        if "$PYTHON" "$here/execute.py" "$work" "$work/$1/controller" "$work/$1.part.csv" $options \
            --seed "$1" > "$work/$1.json"; then
            mv "$work/$1.part.csv" "$work/$1.csv"
            return
        fi
        echo "run.sh: execution $1 was stopped ($(cat "$work/$1.json")); once more" >&2
    done
    stop "an execution that comes to its end" "three that were stopped" "see $work/$1.json"
}

# ---- before learning: rigid body and feedback
[ -e "$work/robot.json" ] || "$PYTHON" "$here/prepare.py" "$work"
k=0
while :; do
    [ -x "$work/$k/controller" ] || build "$work/$k"
    [ -e "$work/$k.csv" ] || execute $k
    echo "run.sh: execution $k: $(cat "$work/$k.json")"
    next=$((k + 1))
    [ $next -lt "$EXECUTIONS" ] || break
    # ---- learn from it: the first time from the model, then from the last feedforward
    if [ ! -e "$work/learned/$next/feedforward.json" ]; then
        mkdir -p "$work/learned"
        # shellcheck disable=SC2086,SC2046
        if [ $k -eq 0 ]; then
            "$PYTHON" -m jaxidl learn "$work/$k.csv" --model "$work/arm.xml" $LEARN \
                $(cat "$work/learn.options") --out "$work/learned/$next"
        else
            "$PYTHON" -m jaxidl learn "$work/$k.csv" --continue "$work/learned/$k" \
                --out "$work/learned/$next"
        fi
    fi
    # ---- and write it as C
    [ -e "$work/$next/arm.c" ] || "$PYTHON" -m jaxidl export "$work/learned/$next" --c --name arm \
        --gains "$work/gains.yaml" --bands 80 30 --out "$work/$next"
    k=$next
done

# ---- what becomes of the robot if something goes wrong, and what the gap finder says to the logs
if [ "$MORE" = yes ]; then
    [ -e "$work/stops.json" ] || "$PYTHON" "$here/stops.py" "$work"
    [ -e "$work/gap/report.json" ] || "$PYTHON" -m jaxidl gap "$work/0.csv" "$work/1.csv" \
        --model "$work/arm.xml" --out "$work/gap"
fi

"$PYTHON" "$here/draw.py" "$work" "$figures"
