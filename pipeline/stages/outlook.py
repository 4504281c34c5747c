"""What a run will fit before it can go on, and about how long that takes."""

from __future__ import annotations

from collections.abc import Sequence

from motionlake.deep_motifs.config import PRETRAINED_WORDS
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.config import LakeConfig
from motionlake.lake.layout import Lake
from motionlake.pesta.posture_network import training_seconds
from motionlake.stages import (
    descriptors,
    embed,
    frames,
    mirrored,
    motifs,
    neighbours,
    postures,
    signatures,
    submotions,
    symbols,
    synthesis,
    transitions,
    words,
)
from motionlake.stages.derived import Part


def outlook(con: Connection, config: LakeConfig, stages: Sequence[str], *, refit: bool) -> list[str]:
    """A line for each model that would be fitted."""
    lines = []
    network = embed.fitting_network(con, config)
    if "embed" in stages:
        if network is None and not refit and PRETRAINED_WORDS.fits(config.words, config.network):
            lines.append("embed: will not train; the ready-made network embeds the words")
        elif network is None or refit:
            minutes = config.network.seconds(_words(con, config)) / 60
            lines.append(
                f"embed: will train a word network ({config.network.architecture}), about {minutes:.1f} minutes"
            )
        else:
            lines.append(f"embed: will not train; {network.model} embeds the words")
    if "motifs" in stages:
        fitted = motifs.fitting_motifs(con, config, network) if network else None
        if fitted is None or refit:
            lines.append(f"motifs: will fit {config.motifs.k} motifs")
        else:
            lines.append(f"motifs: will not fit; new words are assigned to {fitted.model}")
    if postures.NAME in stages:
        lines.append(_dictionary(con, config, refit=refit))
    if descriptors.NAME in stages:
        lines.append(_descriptor_network(con, config, refit=refit))
    if submotions.NAME in stages:
        lines.append(_submotion_network(con, config, refit=refit))
    if synthesis.NAME in stages:
        lines.append(_generator(con, config, refit=refit))
    if neighbours.NAME in stages:
        index = neighbours.fitting_index(con, config)
        lines.append(
            "neighbours: will index all words of the lake"
            if index is None or refit
            else f"neighbours: will not index; words are sought in {index.model} ({index.figures['clips']:.0f} clips)"
        )
    return lines


def _dictionary(con: Connection, config: LakeConfig, *, refit: bool) -> str:
    dictionary = postures.fitting_dictionary(con, config)
    if dictionary is not None and not refit:
        return f"postures: will not train; frames are coded with {dictionary.model}"
    if not refit and postures.takes_ready_made(con, config):
        return "postures: will not train; the ready-made dictionary codes the frames"
    minutes = training_seconds(config.postures, postures.count(con, config)) / 60
    kind = f"{config.postures.m} symbols ({config.postures.dictionary})"
    return f"postures: will train a dictionary of {kind}, about {minutes:.1f} minutes"


def _descriptor_network(con: Connection, config: LakeConfig, *, refit: bool) -> str:
    network = descriptors.fitting_network(con, config)
    if network is not None and not refit:
        return f"descriptors: will not train; {network.model} describes the clips"
    if not refit and descriptors.takes_ready_made(con, config):
        return "descriptors: will not train; the ready-made network describes the clips"
    return f"descriptors: will train a descriptor network ({config.descriptors.recipe})"


def _submotion_network(con: Connection, config: LakeConfig, *, refit: bool) -> str:
    network = submotions.fitting_network(con, config)
    if network is not None and not refit:
        return f"submotions: will not train; {network.model} reads the windows of clips"
    if not refit and submotions.takes_ready_made(con, config):
        return "submotions: will not train; the ready-made network reads the windows of clips"
    return f"submotions: will train a sub-motion network ({config.submotion.recipe})"


def _generator(con: Connection, config: LakeConfig, *, refit: bool) -> str:
    generator = synthesis.fitting_generator(con, config)
    if generator is not None and not refit:
        return f"synth: will not train; {generator.model} makes motion"
    if not refit and synthesis.takes_ready_made(con, config):
        return "synth: will not train; the ready-made generator makes motion"
    return f"synth: will train a generator of motion ({config.synthesis.recipe})"


def pending(con: Connection, lake: Lake, config: LakeConfig) -> dict[str, int]:
    """How many parts each stage still lacks.

    For "frames": planned shards that have not run; for "synth": 1 where the generator is for another configuration.
    """
    network = embed.fitting_network(con, config)
    model = motifs.fitting_motifs(con, config, network) if network else None
    wanted: dict[str, list[Part] | None] = {words.NAME: words.keyed(con, config.words)}
    wanted[embed.NAME] = embed.keyed(con, lake, config, network) if network else None
    assigned = motifs.keyed(con, lake, config, network, model) if network and model else None
    wanted[motifs.NAME] = assigned
    signed = signatures.keyed(assigned, model) if assigned is not None and model else None
    wanted[signatures.NAME] = signed
    wanted[mirrored.NAME] = mirrored.keyed(signed) if signed is not None else None
    dictionary = postures.fitting_dictionary(con, config)
    wanted[postures.NAME] = postures.keyed(con, lake, dictionary) if dictionary else None
    wanted[symbols.NAME] = symbols.keyed(con, lake, config, dictionary) if dictionary else None
    described = descriptors.fitting_network(con, config)
    wanted[descriptors.NAME] = descriptors.keyed(con, lake, described) if described else None
    second = submotions.fitting_network(con, config)
    wanted[submotions.NAME] = submotions.keyed(con, lake, second) if second else None
    due = {frames.NAME: sum(r["state"] == "planned" for r in fetch(con, "shards", {"stage": frames.NAME}))}
    for stage, parts in wanted.items():
        done = {r["key"] for r in fetch(con, "shards", {"stage": stage}) if r["state"] == "ok"}
        due[stage] = len(wanted[words.NAME] or []) if parts is None else sum(p.key not in done for p in parts)
    due[neighbours.NAME] = neighbours.pending(con, config)
    due[transitions.NAME] = transitions.pending(con, lake, config)
    due[synthesis.NAME] = int(synthesis.outdated(con, config))
    return due


def _words(con: Connection, config: LakeConfig) -> int:
    """Words of the lake; from its seconds where they are not cut yet."""
    seconds = fetch(con, "total_seconds")[0]["seconds"]
    return int(seconds * config.words.fps / config.words.stride) or config.network.max_words
