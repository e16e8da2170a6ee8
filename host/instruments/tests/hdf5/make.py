"""Writes gedi.h5 and lvis.h5 as the archives do, and an array that was never filled, by the HDF
Group's library: pip install h5py."""

import math

import h5py
import numpy


def shot(samples, places, ambient=200.0):
    """A waveform of pulses of 7 samples (full width at half maximum), 300 high."""
    at = numpy.arange(samples)
    wave = numpy.full(samples, ambient)
    for place in places:
        wave += 300.0 * numpy.exp(-4 * math.log(2) * (at - place) ** 2 / 49.0)
    # A ramp of a sixteenth in turn instead of noise: its values repeat, so the file stays small.
    return wave + (at * 7 % 5) / 16.0


def beam(file, name, places):
    """Groups and names of GEDI's level 1B: shots end to end, indices from 1."""
    group = file.create_group(name)
    for prefix, lengths, of_shot in [
        ("rx", [120 + 10 * k for k in range(len(places))], places),
        ("tx", [60] * len(places), [[20 + k] for k in range(len(places))]),
    ]:
        waves = [shot(n, at) for n, at in zip(lengths, of_shot)]
        # The archive keeps samples between the shots, too.
        spaced = numpy.concatenate([numpy.append(wave, 7.0) for wave in waves])
        starts = numpy.cumsum([1] + [n + 1 for n in lengths[:-1]])
        more = dict(chunks=True, compression="gzip", shuffle=True)
        group.create_dataset(f"{prefix}waveform", data=spaced.astype("<f4"), **more)
        group.create_dataset(f"{prefix}_sample_start_index", data=starts.astype("<u8"), **more)
        group.create_dataset(f"{prefix}_sample_count", data=numpy.array(lengths, "<u2"), **more)
    group.create_dataset("shot_number", data=numpy.arange(len(places), dtype="<u8"))


with h5py.File("gedi.h5", "w", libver="earliest") as file:
    file.create_group("METADATA").attrs["short_name"] = "GEDI_L1B"
    beam(file, "BEAM0000", [[40], [50, 90], [60]])
    beam(file, "BEAM0101", [[45], [70]])

with h5py.File("lvis.h5", "w", libver="latest") as file:
    waves = numpy.array([shot(150, [50]), shot(150, [60, 100])])
    waves[1, 140:] = 65000.0
    received = file.create_dataset("RXWAVE", data=waves.round().astype(">u2"), fletcher32=True)
    received.attrs["_FillValue"] = numpy.uint16(65000)
    pulses = numpy.array([shot(60, [20]), shot(60, [21])]).round()
    file.create_dataset("TXWAVE", data=pulses.astype(">u2"))
    file.create_dataset("SHOTNUMBER", data=numpy.arange(2, dtype="<u4"))
    file.create_dataset("cube", data=numpy.zeros((2, 3, 4), "<f4"))

with h5py.File("empty.h5", "w", libver="latest") as file:
    file.create_dataset("RXWAVE", shape=(10**6, 10**6), chunks=(64, 64), dtype="u1")
