#!/bin/bash
#SBATCH --job-name=spectrasplat
#SBATCH --output=%x-%A_%a.log
# One picture in parts on Slurm:
#
#   PARTS=64 bash picture.sh SCENE PICTURE.exr [options of 'spectrasplat render'] [-- options of sbatch]
#   PARTS=64 bash picture.sh lens.toml lens.exr --photons 1G --size 1920x1080 -- --gres=gpu:1 --time=1:00:00
#
# It submits itself: an array with a task a part, arrays that merge 64 each while there are more, and one task that makes
# the picture. Parts lie in PICTURE.exr.parts, on a file system that all nodes share; a task that is repeated leaves alone
# what is there, and what was killed left nothing. Ask for nodes of one kind: their maps must lie at the same places.
set -eu
FAN_IN=64

if [ -z "${SPECTRASPLAT_STEP:-}" ]; then
    scene=$1 picture=$2
    shift 2
    render=() slurm=()
    while [ $# -gt 0 ] && [ "$1" != -- ]; do render+=("$1"); shift; done
    [ $# -eq 0 ] || { shift; slurm=("$@"); }
    export PARTS=${PARTS:-16}
    mkdir -p "$picture.parts"
    # Everything that a step needs is in its arguments: the environment may not travel.
    submit() { # step, tasks, job that comes before
        sbatch --parsable --array="1-$2" ${3:+--dependency=afterok:$3} ${slurm[@]+"${slurm[@]}"} \
            --export="ALL,SPECTRASPLAT_STEP=$1,PARTS=$PARTS" "$0" "$scene" "$picture" ${render[@]+"${render[@]}"}
    }
    job=$(submit 0 "$PARTS" "")
    job=${job%%;*} level=0 files=$PARTS
    while [ "$files" -gt $FAN_IN ]; do
        level=$((level + 1)) files=$(((files + FAN_IN - 1) / FAN_IN))
        job=$(submit "$level" "$files" "$job")
        job=${job%%;*}
    done
    job=$(submit "picture$level" 1 "$job")
    echo "job ${job%%;*} will write $picture"
    exit
fi

scene=$1 picture=$2 task=$SLURM_ARRAY_TASK_ID
shift 2
folder=$picture.parts
case $SPECTRASPLAT_STEP in
0)
    part=$folder/0-$task.ssp
    [ -e "$part" ] || exec spectrasplat render "$scene" "$@" --passes "$task/$PARTS" -o "$part"
    ;;
picture*)
    exec spectrasplat merge "$folder/${SPECTRASPLAT_STEP#picture}"-*.ssp --scene "$scene" -o "$picture"
    ;;
*)
    below=$((SPECTRASPLAT_STEP - 1)) merged=$folder/$SPECTRASPLAT_STEP-$task.ssp
    parts=()
    for ((i = (task - 1) * FAN_IN + 1; i <= task * FAN_IN; i++)); do
        [ ! -e "$folder/$below-$i.ssp" ] || parts+=("$folder/$below-$i.ssp")
    done
    [ -e "$merged" ] || exec spectrasplat merge "${parts[@]}" -o "$merged"
    ;;
esac
