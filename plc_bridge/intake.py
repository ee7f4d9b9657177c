"""The intake of a link's requests on their way to the scan thread: by a number, a torn block or the edge of a coil; pure."""

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

from plc_bridge.coils import Edge
from plc_bridge.images import CommandImage
from plc_bridge.lease import CellLease
from plc_bridge.links import Link, Order
from plc_bridge.messages import UNNUMBERED, Command, Control, Refusal
from plc_bridge.orders import Orders
from plc_bridge.refusals import CONTROLS, STOPS, BadParameterError, Rules
from plc_bridge.registers import AFTER_A_LOSS
from plc_bridge.sequence_numbers import Verdict


@dataclass(frozen=True, slots=True)
class Intake:
    """Turns requests of links into orders or refusals.

    Args:
        rules: Rules for accepted commands.
        lease: The lease of the cell.
        orders: Receiver of the orders.
        links: All links, by their source.
    """

    rules: Rules
    lease: CellLease
    orders: Orders
    links: Mapping[str, Link]

    @property
    def stops_held(self) -> int:
        """Number of connections that hold their stop coil at 1."""
        return sum(len(link.stops) for link in self.links.values())

    # Numbers.

    def take_number(self, link: Link, image: CommandImage, now: float, code_before: int) -> None:
        """Process the number of a whole block; `code_before` is the code of the previous write."""
        numbers = link.numbers
        verdict = numbers.see(image.sequence, image.asked, image.life)
        if verdict is Verdict.ANEW:
            link.was_lost, link.executed, link.resetting = False, None, None
            link.aside = Order(_command_of(link, image.sequence, image), is_decided=True)
        if numbers.is_anew and not numbers.is_in_doubt:
            numbers.is_anew = False
            link.begin_anew()
        if verdict is Verdict.LATE or (verdict is Verdict.DOUBT and image.code in STOPS):
            self._take_late(link, image)
        elif verdict is Verdict.SAME:
            self._take_same(link, image, code_before)
        elif verdict in (Verdict.FIRST, Verdict.NEW):
            link.executed = link.resetting = None
            if verdict is Verdict.FIRST and image.code not in STOPS:
                self._adopt(link, image)
            elif image.code == Control.NONE:
                self._empty(link, image)
            else:
                self.command(link, image.sequence, image, now)

    def _take_same(self, link: Link, image: CommandImage, code_before: int) -> None:
        """Process a repeated number: only a stop is obeyed; a number first written without a command cannot be used again."""
        link.was_lost = False
        if link.aside is not None and link.aside.sequence != image.sequence:
            link.aside = None
        if image.code == code_before:
            return
        is_empty = link.came_empty(image.sequence)
        if image.code in STOPS:
            self._stop(link, image, image.sequence if is_empty else UNNUMBERED)
        elif image.code != Control.NONE and is_empty:
            self._refuse_new(link, image, image.sequence, Refusal.ADOPTED)

    def _take_late(self, link: Link, image: CommandImage) -> None:
        """Answer a number behind the last one without replacing the last answer: obey a stop, refuse another command."""
        run, aside = link.shown, link.aside
        if run is not None and run.is_program and run.repeats(image):
            return  # the number of the present run, behind those of later controls
        if aside is not None and aside.repeats(image) and aside.command.code == image.code:
            return
        link.aside = Order(_command_of(link, image.sequence, image))
        if image.code in STOPS:
            self.orders.stop(link.aside)
        else:
            self.orders.turn_down(link.aside, Refusal.LATE)

    def _adopt(self, link: Link, image: CommandImage) -> None:
        """Adopt a first number without running its command; the number of the run in view changes nothing."""
        shown = link.shown
        if link.has_resumed or (shown is not None and shown.is_program and shown.repeats(image)):
            link.was_lost = False
        elif image.code == Control.NONE:
            self._empty(link, image)
        else:
            self._refuse_new(link, image, image.sequence, Refusal.ADOPTED)

    def _empty(self, link: Link, image: CommandImage) -> None:
        """Answer a number without a command."""
        order = Order(_command_of(link, image.sequence, image), link)
        link.add(order)
        self.orders.decide(order)

    def _refuse_new(self, link: Link, image: CommandImage, sequence: int, refusal: Refusal) -> Order:
        """Answer a number with a refusal."""
        detail = AFTER_A_LOSS if refusal is Refusal.ADOPTED and link.was_lost else 0
        order = Order(_command_of(link, sequence, image), link, detail=detail)
        link.add(order)
        self.orders.turn_down(order, refusal)
        return order

    def _stop(self, link: Link, image: CommandImage, sequence: int = UNNUMBERED) -> Order:
        """Stop at once; a stop with its own number gets its own answer, one with the run's number gets the run's."""
        shown = link.shown
        if shown is not None and shown.is_program and shown.sequence == sequence:
            sequence = UNNUMBERED
        order = Order(_command_of(link, sequence, image), link if sequence != UNNUMBERED else None)
        if order.link is not None:
            link.add(order)
        self.orders.stop(order)
        return order

    # Coils.

    def take_coils(self, link: Link, coils: Mapping[str, bool], by: Hashable, now: float) -> None:
        """Process the coils that a connection of a link has just written."""
        if coils.get("stop") is False:
            link.stops.discard(by)
        elif "stop" in coils and by not in link.stops:
            link.stops.add(by)
            self._stop(link, CommandImage(code=Control.STOP))
        image = link.image or CommandImage()
        link.has_spoken |= bool(coils.keys() & {"execute", "reset"})
        link.executed = self._take_edge(link, "execute", coils, link.executed, image, now)
        image = replace(image, code=Control.RESET)
        link.resetting = self._take_edge(link, "reset", coils, link.resetting, image, now)

    def _take_edge(
        self,
        link: Link,
        coil: Literal["execute", "reset"],
        coils: Mapping[str, bool],
        before: Order | None,
        image: CommandImage,
        now: float,
    ) -> Order | None:
        """Return the request made by a write of a coil; otherwise `before`, the request of an earlier write."""
        edge = link.coils.take(coil, coils)
        if edge is Edge.ROSE:
            return self.command(link, link.numbers.count_up(), image, now)
        if edge is Edge.UNSEEN:
            return self._refuse_new(link, image, link.numbers.count_up(), Refusal.ADOPTED)
        if edge is Edge.LOW and before is not None and before.is_read:
            self.orders.end(before)
        return before

    # Commands.

    def control(self, link: Link, code: int) -> Order:
        """Answer a control without a number, or pass it on; the order alone holds its answer."""
        image = CommandImage(code=code)
        if code in STOPS:
            return self._stop(link, image)
        order, refusal = Order(_command_of(link, UNNUMBERED, image)), self._why_not(link, image)
        if refusal is not Refusal.NONE:
            self.orders.turn_down(order, refusal)
            return order
        self.lease.take(link)
        self.orders.add(order)
        return order

    def command(self, link: Link, sequence: int, image: CommandImage, now: float) -> Order:
        """Answer a new number, or pass its command on to the scan thread."""
        if image.code in STOPS:
            return self._stop(link, image, sequence)
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
            self.orders.turn_down(order, refusal)
            return order
        self.lease.take(link)
        self.orders.add(order)
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
        if (self.orders.run is not None and image.code not in CONTROLS) or self.orders.is_full:
            return Refusal.BUSY
        return Refusal.NONE

    # Torn blocks.

    def take_torn(self, link: Link, image: CommandImage) -> None:
        """Obey the stop code of a new number at once, although the code may belong to another number.

        The number is answered when the block is whole.
        """
        self.orders.counts.torn += 1
        if image.code in STOPS and image.sequence not in (link.numbers.last, link.torn_stop):
            link.torn_stop = image.sequence
            self._stop(link, image)

    def refuse_torn(self, link: Link) -> None:
        """Answer the number of a block that has been torn for too long."""
        link.watchdog.torn_since, image = None, link.image
        if image is not None and link.numbers.would_count(image.sequence):
            link.numbers.see(image.sequence, image.asked, image.life)
            self._refuse_new(link, image, image.sequence, Refusal.TORN)


def _command_of(
    link: Link, sequence: int, image: CommandImage, parameters: tuple[tuple[str, float], ...] = ()
) -> Command:
    return Command(sequence, image.code, image.recipe, image.serial, parameters, link.source)
