#!/usr/bin/env bash
# Runs the commands of docs/farm.md as they stand there, and the job templates beside this script where a farm meets trouble.
#
#     tile-runner/farm/test.sh path/of/linpred [python]
#
# The interpreter should have openjd-cli; without it the templates are said to be NOT TESTED. `sbatch` is a stand-in that runs a job at once.
set -euo pipefail

repository=$(cd "$(dirname "$0")/../.." && pwd)
linpred=$(realpath "$1")
python=${2:-python3}
page=$repository/docs/farm.md
templates=tile-runner/farm

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
mkdir "$scratch/bin" "$scratch/blocks"
ln -s "$linpred" "$scratch/bin/linpred"
ln -s "$repository/tests" "$repository/tile-runner" "$scratch/"
export PATH=$scratch/bin:$PATH
cd "$scratch"

fail() {
    echo "FAILED: $*" >&2
    exit 1
}

# Says what a command printed if it does not end with this code.
ends_with() {
    local expected=$1 log=$2 code=0
    shift 2
    "$@" >"$log" 2>&1 || code=$?
    if [ "$code" -ne "$expected" ]; then
        cat "$log" >&2
        fail "$* ended with $code, not $expected"
    fi
}

says() {
    grep -qF -- "$2" "$1" || {
        cat "$1" >&2
        fail "the log does not say: $2"
    }
}

have_openjd() {
    "$python" -c 'import openjd.cli' 2>/dev/null
}

stand_ins() {
    if have_openjd; then
        printf '#!/bin/sh\nexec "%s" -m openjd "$@"\n' "$python" >bin/openjd
    fi
    cat >bin/sbatch <<'STUB'
#!/usr/bin/env bash
# Runs a job at once, task after task; a job that depends on one which failed is not run.
set -euo pipefail
array='' parsable=no after=''
while [[ $1 == --* ]]; do
    case $1 in
        --parsable) parsable=yes ;;
        --array=*) array=${1#*=} ;;
        --dependency=afterok:*) after=${1##*:} ;;
        --export=ALL,*) IFS=, read -ra pairs <<<"${1#*=ALL,}" && export "${pairs[@]}" ;;
        --kill-on-invalid-dep=yes) ;;
        *) echo "sbatch: unknown option $1" >&2 && exit 1 ;;
    esac
    shift
done
mkdir -p jobs
id=$(ls jobs | wc -l)
mkdir "jobs/$id"
echo ok >"jobs/$id/end"
SLURM_CPUS_PER_TASK=$(sed -n 's/^#SBATCH --cpus-per-task=//p' "$1")
export SLURM_CPUS_PER_TASK
if [ -n "$after" ] && [ "$(cat "jobs/$after/end")" != ok ]; then
    echo "never ran" >"jobs/$id/end"
elif [ -n "$array" ]; then
    for task in $(seq "${array%-*}" "${array#*-}"); do
        SLURM_ARRAY_TASK_ID=$task bash "$1" >"jobs/$id/$task.log" 2>&1 || echo failed >"jobs/$id/end"
    done
else
    bash "$1" >"jobs/$id/log" 2>&1 || echo failed >"jobs/$id/end"
fi
if [ "$parsable" = yes ]; then echo "$id"; else echo "Submitted batch job $id"; fi
STUB
    chmod +x bin/*
}

# The page's blocks of shell, in order: blocks/1, blocks/2 ...
blocks() {
    awk '/^```sh$/ { inside = 1; number++; next } /^```$/ { inside = 0 } inside { print > ("blocks/" number) }' "$page"
    [ -s blocks/1 ] || fail "$page has no commands"
}

# Runs every block, or keeps it under the name that its second line gives.
the_page() {
    local number=0 name
    while [ -e "blocks/$((++number))" ]; do
        bash -n "blocks/$number"
        if [ "$(head -n 1 "blocks/$number")" = '#!/bin/bash' ]; then
            name=$(sed -n '2s/^# //p' "blocks/$number")
            cp "blocks/$number" "$name"
        elif grep -q '^openjd ' "blocks/$number" && ! have_openjd; then
            continue
        else
            ends_with 0 "blocks/$number.log" bash -euo pipefail "blocks/$number"
        fi
    done
}

# What every way through a farm must come to.
references() {
    local frame
    mkdir -p references
    for frame in 0001 0002 0003 0004; do
        linpred denoise -q "farm/noisy/shot.$frame.exr" -o "references/clean.$frame.exr"
    done
}

is_the_reference() {
    local frame
    for frame in 0001 0002 0003 0004; do
        cmp "references/clean.$frame.exr" "$1/clean.$frame.exr" || fail "$1: frame $frame is not what linpred denoise makes"
    done
}

jobs_ended_well() {
    local job
    for job in jobs/*; do
        [ "$(cat "$job/end")" = ok ] || {
            cat "$job"/*log >&2
            fail "$job: $(cat "$job/end")"
        }
    done
}

# A band of a frame that is not there: its frame is not stitched.
slurm_stops_at_a_failure() {
    local failed
    failed=$(sbatch --parsable --array=1-2 --export=ALL,BANDS=2,FRAME=9 bands.sbatch)
    says "jobs/$failed/1.log" "cannot read farm/noisy/shot.0009.exr"
    sbatch --dependency=afterok:"$failed" --kill-on-invalid-dep=yes --export=ALL,BANDS=2,FRAME=9 stitch.sbatch >/dev/null
    [ "$(cat "jobs/$((failed + 1))/end")" = "never ran" ] || fail "a frame was stitched of bands that failed"
}

openjd_job() {
    local template=$1
    shift
    openjd run "$templates/$template/template.yaml" -p InputDir=farm/noisy -p 'InputPattern=shot.####.exr' -p Bands=2 -p BandsDir=farm/bands "$@"
}

# The progress of each task grows, and ends at 100 in all `$2` of them.
progress_grows() {
    awk -F '\t' -v tasks="$2" '
        $2 ~ /Running Task/ { last = 0; seen++ }
        $2 ~ /^openjd_progress: / {
            split($2, words, " ")
            if (words[2] <= last) { print "from " last " to " words[2]; exit bad = 1 }
            last = words[2]
            if (last == 100) ended++
        }
        END { if (bad || seen != tasks || ended != tasks) { print seen " tasks, " ended " ended at 100"; exit 1 } }
    ' "$1" || fail "$1: progress goes back or does not end"
}

the_page_shows_what_openjd_says() {
    local check
    for check in frames bands; do
        says "$page" "Template at 'tile-runner/farm/$check/template.yaml' passes validation checks."
        says blocks/2.log "Template at 'tile-runner/farm/$check/template.yaml' passes validation checks."
    done
    progress_grows blocks/3.log 2
    says blocks/3.log "openjd_status: $PWD/farm/noisy/shot.0004.exr (2 of 2)"
    says blocks/4.log "2. 'Stitch' (4 total Tasks)"
    # 2 task chunks x 2 bands, 4 stitches
    progress_grows blocks/4.log 8
}

frames_with_a_step_make_task_chunks() {
    ends_with 0 steps.log openjd run $templates/frames/template.yaml -p InputDir=farm/noisy -p 'InputPattern=shot.####.exr' \
        -p OutputDir=farm/steps -p Frames=1-3:2,4 -p FramesPerTask=3
    progress_grows steps.log 1
    [ "$(ls farm/steps)" = "$(printf 'clean.%04d.exr\n' 1 3 4)" ] || fail "frames 1-3:2,4 made $(ls farm/steps)"
}

a_failure_fails_its_task_and_is_mended() {
    mkdir broken
    cp farm/noisy/shot.000[134].exr broken/
    head -c 500000 farm/noisy/shot.0002.exr >broken/shot.0002.exr
    local run=(openjd run $templates/frames/template.yaml -p InputDir=broken -p 'InputPattern=shot.####.exr' -p OutputDir=farm/mended
        -p FramesPerTask=4)
    ends_with 1 broken.log "${run[@]}" -p Frames=1-4
    says broken.log "openjd_fail: 1 of 4 frames failed: $PWD/broken/shot.0002.exr:"
    says broken.log "exited with code: 3"
    [ "$(ls farm/mended)" = "$(printf 'clean.%04d.exr\n' 1 3 4)" ] || fail "beside a broken frame there are $(ls farm/mended)"
    ends_with 1 missing.log "${run[@]}" -p Frames=9
    says missing.log "openjd_fail: 1 of 1 frames failed: cannot read $PWD/broken/shot.0009.exr: No such file"

    cp farm/noisy/shot.0002.exr broken/
    ends_with 0 mended.log "${run[@]}" -p Frames=1-4
    says mended.log "clean.0004.exr exists, skipped"
    progress_grows mended.log 1
    is_the_reference farm/mended
}

options_reach_linpred() {
    local out="farm/it's \$(touch taken) \"here\"; *"
    ends_with 0 options.log openjd run $templates/frames/template.yaml -p InputDir=farm/noisy -p 'InputPattern=shot.####.exr' \
        -p OutputDir="$out" -p Frames=1 -p Quality=fast -p Threads=1 -p Options='--error-layer --map albedo=none --quiet'
    [ ! -e taken ] || fail "the name of a folder was taken for a command"
    linpred denoise -q farm/noisy/shot.0001.exr -o expected.exr --quality fast --error-layer --map albedo=none
    cmp expected.exr "$out/clean.0001.exr" || fail "options do not make what they make"
    ends_with 1 layers.log openjd run $templates/frames/template.yaml -p InputDir=farm/noisy -p 'InputPattern=shot.####.exr' \
        -p OutputDir=farm/none -p Frames=1 -p Layers='no such layer'
    says layers.log "no such layer"
    ends_with 1 absent.log openjd run $templates/frames/template.yaml -p InputDir=farm/noisy -p 'InputPattern=shot.####.exr' \
        -p OutputDir=farm/none -p Frames=1 -p Linpred=no-such-command
    says absent.log "openjd_fail: this worker has no command no-such-command"
}

bands_are_removed_if_that_is_asked_for() {
    [ "$(ls farm/bands | wc -l)" -eq 8 ] || fail "of 4 frames in 2 bands there are $(ls farm/bands)"
    # that a step is run at all is its dependency's doing
    ends_with 0 removed.log openjd_job bands -p OutputDir=farm/removed -p Frames=1-4 -p RemoveBands=true --step Stitch --run-dependencies
    says removed.log "1of2.clean.0001.exr exists, skipped"
    is_the_reference farm/removed
    [ -z "$(ls farm/bands)" ] || fail "bands were left: $(ls farm/bands)"
    ends_with 1 too-many.log openjd_job bands -p OutputDir=farm/too-many -p Frames=1 -p Bands=60
    says too-many.log "openjd_fail: 1 of 1 frames failed: --band 1/60: is empty"
}

# What a farm does when it stops a task.
a_task_that_is_stopped_leaves_nothing() {
    local job
    openjd run $templates/frames/template.yaml -p InputDir=farm/noisy -p 'InputPattern=shot.####.exr' -p OutputDir=farm/stopped \
        -p Frames=1-4 -p FramesPerTask=4 -p Options='--coverage 1024 --threads 1' >stopped.log 2>&1 &
    job=$!
    until grep -q 'openjd_progress: ' stopped.log; do
        kill -0 "$job" 2>/dev/null || fail "the job ended before it was stopped: $(cat stopped.log)"
        sleep 0.01
    done
    kill -TERM "$job"
    ! wait "$job" || fail "a job that was stopped ended well"
    says stopped.log "openjd_fail: stopped before the end"
    says stopped.log "exited with code: 143"
    ! compgen -G 'farm/stopped/*.part' >/dev/null || fail "half-written: $(ls farm/stopped)"
}

stand_ins
blocks
the_page
references
is_the_reference farm/by-slurm
is_the_reference farm/by-slurm-bands
is_the_reference farm/by-xargs
jobs_ended_well
slurm_stops_at_a_failure
echo "docs/farm.md: its commands for xargs and Slurm (with a stand-in for sbatch) make what linpred denoise makes"
if have_openjd; then
    is_the_reference farm/by-frames
    is_the_reference farm/by-bands
    the_page_shows_what_openjd_says
    frames_with_a_step_make_task_chunks
    a_failure_fails_its_task_and_is_mended
    options_reach_linpred
    bands_are_removed_if_that_is_asked_for
    a_task_that_is_stopped_leaves_nothing
    echo "docs/farm.md: so do its job templates, which are valid, show progress, fail with a sentence and are restarted ($("$python" -m openjd --version | head -n 1))"
else
    echo "NOT TESTED: job templates of Open Job Description: $python has no openjd-cli"
fi
