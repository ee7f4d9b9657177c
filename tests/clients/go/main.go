// A PLC on simonvetter's Modbus client: runs insert_peg COUNT times and counts the answers.
//
//	client URL COUNT HEADER [CERTIFICATE KEY AUTHORITY]
//
// URL is tcp://HOST:PORT, tcp+tls://HOST:PORT or rtu://PORT. HEADER is what `cell map --format h` prints: every address
// and every number comes from there.
package main

import (
	"crypto/tls"
	"errors"
	"fmt"
	"os"
	"regexp"
	"strconv"
	"time"

	"github.com/simonvetter/modbus"
)

const (
	mostCycles = 1000000
	cycleTime  = time.Millisecond
)

type plc struct {
	line            *modbus.ModbusClient
	names           map[string]uint16
	command, report []uint16
}

func imported(header string) map[string]uint16 {
	text, err := os.ReadFile(header)
	must("HEADER", err)
	names := map[string]uint16{}
	for _, found := range regexp.MustCompile(`(?m)^#define CELL_(\w+) (\d+)`).FindAllStringSubmatch(string(text), -1) {
		number, err := strconv.ParseUint(found[2], 10, 16)
		must(found[1], err)
		names[found[1]] = uint16(number)
	}
	return names
}

func (p *plc) told(name string) uint16 {
	return p.report[p.names["REPORT_"+name]]
}

func (p *plc) put(name string, value uint16) {
	p.command[p.names["COMMAND_"+name]] = value
}

func must(what string, err error) {
	if err != nil {
		fmt.Printf("%s: %v\n", what, err)
		os.Exit(1)
	}
}

func (p *plc) read() {
	for {
		report, err := p.line.ReadRegisters(p.names["REPORT_LIFE"], p.names["REPORT_SIZE"], modbus.INPUT_REGISTER)
		must("FC4", err)
		p.report = report
		if p.told("LIFE") == p.told("LIFE_TAIL") {
			return
		}
	}
}

func (p *plc) cycle() {
	life := p.command[p.names["COMMAND_LIFE"]]%0xFFFF + 1
	p.put("LIFE", life)
	p.put("LIFE_TAIL", life)
	must("FC16", p.line.WriteRegisters(p.names["COMMAND_LIFE"], p.command))
	p.read()
	time.Sleep(cycleTime)
}

func (p *plc) run() bool {
	sequence := p.command[p.names["COMMAND_SEQUENCE"]] + 1
	p.put("SEQUENCE", sequence)
	p.put("CODE", p.names["CODE_INSERT_PEG"])
	isEnded := func() bool {
		return p.told("SEQUENCE") == sequence && p.told("RESULT") != 0 ||
			p.told("ANSWERED") == sequence && p.told("REFUSAL") != 0
	}
	p.cycle()
	for n := 0; n < mostCycles && !isEnded(); n++ {
		p.cycle()
	}
	isDone := p.told("SEQUENCE") == sequence && p.told("RESULT") == p.names["RESULT_SUCCESS"]
	p.put("ACKNOWLEDGE", sequence)
	for n := 0; n < mostCycles && p.told("RESULT") != 0; n++ {
		p.cycle()
	}
	return isDone && p.told("RESULT") == 0
}

func main() {
	settings := &modbus.ClientConfiguration{URL: os.Args[1], Speed: 115200, Timeout: 10 * time.Second}
	if len(os.Args) == 7 {
		pair, err := tls.LoadX509KeyPair(os.Args[4], os.Args[5])
		must("certificate", err)
		settings.TLSClientCert = &pair
		settings.TLSRootCAs, err = modbus.LoadCertPool(os.Args[6])
		must("authority", err)
	}
	client, err := modbus.NewClient(settings)
	must("client", err)
	must("connect", client.Open())
	defer client.Close()
	client.SetUnitId(1)
	count, err := strconv.Atoi(os.Args[2])
	must("COUNT", err)

	names := imported(os.Args[3])
	size := names["COMMAND_SIZE"]
	p := &plc{line: client, names: names, command: make([]uint16, size)}
	p.read()
	p.put("SEQUENCE", p.told("SEQUENCE"))
	p.put("VERSION", p.told("VERSION"))
	p.cycle()
	done := 0
	for n := 0; n < count; n++ {
		if p.run() {
			done++
		}
	}
	_, err = client.ReadRegister(size, modbus.HOLDING_REGISTER)
	if !errors.Is(err, modbus.ErrIllegalDataAddress) {
		fmt.Printf("FC3 beyond the block: %v\n", err)
		os.Exit(1)
	}
	if client.WriteRegister(size, 1) != modbus.ErrIllegalDataAddress {
		fmt.Println("FC6 beyond the block is taken")
		os.Exit(1)
	}
	fmt.Printf("triggered %d done %d\n", count, done)
}
