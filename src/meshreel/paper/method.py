"""The paper's variants as coding methods."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from meshreel.codec.config import EncoderConfig
from meshreel.codec.methods import LiveStart
from meshreel.codec.open_stream import OpenStream
from meshreel.codec.option import COUNT
from meshreel.codec.paper_options import PaperOptions
from meshreel.codec.source import Source, reporting_frames
from meshreel.errors import CorruptStreamError
from meshreel.paper import settings
from meshreel.paper.decoder import DecodedFrames, PaperBlockDecoder
from meshreel.paper.encoder import PaperBlockCoder
from meshreel.paper.variants import VARIANTS, Variant
from meshreel.runtime.progress import Progress


@dataclass(frozen=True)
class PaperMethod:
    """A variant of the paper, an implementation of `codec.methods.Method`."""

    variant: Variant

    @property
    def name(self) -> str:
        """Name of the variant, as users write it."""
        return self.variant.name

    def check(self, config: EncoderConfig) -> None:
        """Check that the options are compatible; raises as `settings.check`."""
        assert isinstance(config, PaperOptions)
        settings.check(config)

    def encode(self, sources: Sequence[Source], progress: Progress) -> Iterator[bytes]:
        """Yield the stream of the only source."""
        (source,) = sources
        coder = PaperBlockCoder(source.mesh, source.frame, source.blocks(), progress)
        blocks = ((len(vertices), coder.code(vertices)) for vertices in source.blocks())
        coded = reporting_frames(blocks, source.n_frames, progress)
        yield source.stream(coder.leading_sections(), coded)

    def live_coder(self, start: LiveStart) -> PaperBlockCoder:
        """The coder of live frames; without tracks."""
        return PaperBlockCoder(start.mesh, start.frame, [start.first])

    def frames(self, opened: OpenStream, n_modes: int | None) -> DecodedFrames:
        """The decoder of a stream's frames, with the first `n_modes` rows of coefficients.

        Raises
        ------
        InvalidInputError
            If `n_modes` is below 1.
        CorruptStreamError
            If the stream declares tracks, which these methods do not support.
        """
        if n_modes is not None:
            COUNT.check(n_modes, "n_modes")
        if opened.file.info.n_tracks > 1:
            raise CorruptStreamError(
                f"streams of method {self.name} have no tracks; this one declares tracks"
            )
        return DecodedFrames(PaperBlockDecoder(opened, self.variant, n_modes), opened.starts)


METHODS = {variant.name: PaperMethod(variant) for variant in VARIANTS}
