"""The intake of a link's requests, by a number, a torn block or the edge of a coil, on their way to the scan thread; pure."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from plc_bridge.coils import Edge
from plc_bridge.dispatch import Dispatch
from plc_bridge.images import CommandImage
from plc_bridge.lease import CellLease
from plc_bridge.links import Link, Order
from plc_bridge.messages import UNNUMBERED, Command, Control, Refusal
from plc_bridge.refusals import CONTROLS, STOPS, BadParameterError, Rules
from plc_bridge.registers import AFTER_A_LOSS
from plc_bridge.sequence_numbers import Verdict


@dataclass(frozen=True, slots=True)
class Intake:
    """Turns what links write into orders, or into refusals.

    Args:
        rules: Rules of what the cell takes.
        lease: The lease of the cell.
        dispatch: Receiver of the orders.
        links: All links, by their source.
    """

    rules: Rules
    lease: CellLease
    dispatch: Dispatch
    links: Mapping[str, Link]

    @property
    def stops_held(self) -> int:
        """How many links hold their stop coil at 1."""
        return sum(link.coils.stop for link in self.links.values())

    # By number.

    def take_number(self, link: Link, image: CommandImage, now: float, code_before: int = Control.NONE) -> None:
        """Take the number of a whole block: adopted, a command, late, or nothing new; `code_before` is that of the write before."""
        if self._is_late_again(link, image):
            return
        verdict = link.numbers.see(image.sequence)
        if verdict is Verdict.LATE:
            self._refuse_late(link, image)
            return
        link.late = None
        if verdict is not Verdict.SAME:
            link.executed = link.resetting = None
        if verdict is Verdict.FIRST:
            self._adopt(link, image)
        elif verdict is Verdict.NEW:
            self.command(link, image.sequence, image, now)
        elif image.code != code_before:
            self._take_changed(link, image)

    @staticmethod
    def _is_late_again(link: Link, image: CommandImage) -> bool:
        """Tell whether the number is that of the link's own run once more, behind those of later controls: it changes nothing."""
        run, last = link.shown, link.numbers.last
        return (
            last not in (None, image.sequence) and run is not None and run.is_program and run.sequence == image.sequence
        )

    def _take_changed(self, link: Link, image: CommandImage) -> None:
        """Take another code under a number that is known: a stop is obeyed, and one that came without a code is not to be used again."""
        if image.code in STOPS:
            self.dispatch.stop(Order(Command(UNNUMBERED, image.code, source=link.source)))
        elif image.code != Control.NONE and link.came_empty(image.sequence):
            self._refuse_new(link, image.sequence, image, Refusal.ADOPTED)

    def _refuse_late(self, link: Link, image: CommandImage) -> None:
        if link.late is None or link.late.sequence != image.sequence:
            link.late = Order(_command_of(link, image.sequence, image))
            self.dispatch.refuse(link.late, Refusal.LATE)

    def _adopt(self, link: Link, image: CommandImage) -> None:
        """Adopt a first number; of the commands that may come with it only a stop is obeyed."""
        if image.code in STOPS:
            self._command_stop(link, image.sequence, image)
        elif link.has_resumed:
            return
        elif image.code == Control.NONE:
            self._command_nothing(link, image.sequence, image)
        else:
            self._refuse_new(link, image.sequence, image, Refusal.ADOPTED)

    # By coil.

    def take_coils(self, link: Link, coils: Mapping[str, bool], now: float) -> None:
        """Take the coils that a link has just written."""
        if link.coils.take_stop(coils):
            self.dispatch.stop(Order(Command(UNNUMBERED, Control.STOP, source=link.source)))
        image = link.image or CommandImage()
        link.has_spoken |= bool(coils.keys() & {"execute", "reset"})
        edge = link.coils.take_execute(coils)
        link.executed = self._take_edge(link, edge, link.executed, image, now)
        edge = link.coils.take_reset(coils)
        link.resetting = self._take_edge(link, edge, link.resetting, replace(image, code=Control.RESET), now)

    def _take_edge(self, link: Link, edge: Edge, before: Order | None, image: CommandImage, now: float) -> Order | None:
        """Return the request that a write of a coil makes, and `before`, the one of the write before it."""
        if edge is Edge.ROSE:
            return self.command(link, link.numbers.count_up(), image, now)
        if edge is Edge.UNSEEN:
            return self._refuse_new(link, link.numbers.count_up(), image, Refusal.ADOPTED)
        if edge is Edge.LOW and before is not None and before.is_read:
            self.dispatch.end(before)
        return before

    # Commands.

    def command(self, link: Link, sequence: int, image: CommandImage, now: float) -> Order:
        """Answer a number that counts, or pass it on to the scan thread."""
        if image.code in STOPS:
            return self._command_stop(link, sequence, image)
        if image.code == Control.NONE:
            return self._command_nothing(link, sequence, image)
        refusal, detail = self._why_not(link, image), 0
        parameters: tuple[tuple[str, float], ...] = ()
        try:
            parameters = self.rules.parameters_of(image)
        except BadParameterError as error:
            if refusal is Refusal.NONE:
                refusal, detail = Refusal.PARAMETER, error.detail
        order = Order(_command_of(link, sequence, image, parameters), link, detail=detail)
        link.add(order)
        if refusal is not Refusal.NONE:
            self.dispatch.refuse(order, refusal)
            return order
        self.lease.take(link)
        self.dispatch.begin(order)
        if order.is_program:
            link.watchdog.revive(now)
        return order

    def _why_not(self, link: Link, image: CommandImage) -> Refusal:
        refusal = self.rules.refuse_code(image)
        if refusal is not Refusal.NONE:
            return refusal
        if image.code != Control.HOLD and self.stops_held:
            return Refusal.STOP_HELD
        if not self.lease.is_open_to(link):
            return Refusal.NOT_HOLDER
        if (self.dispatch.run is not None and image.code not in CONTROLS) or self.dispatch.is_full:
            return Refusal.BUSY
        return Refusal.NONE

    def _command_nothing(self, link: Link, sequence: int, image: CommandImage) -> Order:
        """Answer a number without a command."""
        link.was_lost = False
        order = Order(_command_of(link, sequence, image), link)
        link.add(order)
        self.dispatch.decide(order)
        return order

    def _refuse_new(self, link: Link, sequence: int, image: CommandImage, refusal: Refusal) -> Order:
        """Answer a number with a refusal."""
        detail = AFTER_A_LOSS if refusal is Refusal.ADOPTED and link.was_lost else 0
        link.was_lost = False
        order = Order(_command_of(link, sequence, image), link, detail=detail)
        link.add(order)
        self.dispatch.refuse(order, refusal)
        return order

    def _command_stop(self, link: Link, sequence: int, image: CommandImage) -> Order:
        order = Order(_command_of(link, sequence, image), link)
        link.add(order)
        self.dispatch.stop(order)
        return order

    # Torn blocks.

    def take_torn(self, link: Link, image: CommandImage) -> None:
        """Stop at once for a new number whose code says so, although it may not be that number's code.

        The number is answered when the block is whole.
        """
        self.dispatch.counts.torn += 1
        if image.code in STOPS and image.sequence not in (link.numbers.last, link.torn_stop):
            link.torn_stop = image.sequence
            self.dispatch.stop(Order(Command(UNNUMBERED, image.code, source=link.source)))

    def refuse_torn(self, link: Link) -> None:
        """Answer the number of a block that has been torn for too long."""
        image, numbers = link.image, link.numbers
        if image is None or image.sequence == numbers.last or numbers.must_adopt:
            return
        numbers.last = image.sequence
        self._refuse_new(link, image.sequence, image, Refusal.TORN)


def repeats(image: CommandImage, order: Order) -> bool:
    """Tell whether a block has the number of `order`, and either its command once more or none at all."""
    command = order.command
    if image.sequence != command.sequence:
        return False
    asked = (command.code, command.recipe, command.serial)
    return image.code == Control.NONE or asked == (image.code, image.recipe, image.serial)


def goes_on(image: CommandImage, earlier: Link) -> bool:
    """Tell whether a block has the number that an earlier link had come to, and either its command once more or none at all."""
    stood = earlier.image
    if stood is None or image.sequence != earlier.numbers.last or image.sequence != stood.sequence:
        return False
    asked = (stood.code, stood.recipe, stood.serial)
    return image.code == Control.NONE or asked == (image.code, image.recipe, image.serial)


def _command_of(
    link: Link, sequence: int, image: CommandImage, parameters: tuple[tuple[str, float], ...] = ()
) -> Command:
    return Command(sequence, image.code, image.recipe, image.serial, parameters, link.source)
