// A PLC on simonvetter's Modbus client: runs insert_peg COUNT times and counts the answers.
//
//	client URL COUNT [CERTIFICATE KEY AUTHORITY]
//
// URL is tcp://HOST:PORT, tcp+tls://HOST:PORT or rtu://PORT. Addresses are those of `cell map`.
package main

import (
	"crypto/tls"
	"errors"
	"fmt"
	"os"
	"strconv"
	"time"

	"github.com/simonvetter/modbus"
)

const (
	life, sequence, code, acknowledge, version, lifeTail, commandWords = 0, 1, 2, 4, 6, 40, 41

	rLife, rVersion, rSequence, rAnswered, rRefusal, rResult, rLifeTail, reportWords = 0, 1, 2, 3, 4, 5, 72, 73

	insertPeg, success, mostCycles = 100, 1, 100000
)

type plc struct {
	line    *modbus.ModbusClient
	command [commandWords]uint16
	report  []uint16
}

func must(what string, err error) {
	if err != nil {
		fmt.Printf("%s: %v\n", what, err)
		os.Exit(1)
	}
}

func (p *plc) read() {
	for {
		report, err := p.line.ReadRegisters(0, reportWords, modbus.INPUT_REGISTER)
		must("FC4", err)
		if report[rLife] == report[rLifeTail] {
			p.report = report
			return
		}
	}
}

func (p *plc) cycle() {
	p.command[life] = p.command[life]%0xFFFF + 1
	p.command[lifeTail] = p.command[life]
	must("FC16", p.line.WriteRegisters(0, p.command[:]))
	p.read()
}

func (p *plc) run() bool {
	p.command[sequence]++
	p.command[code] = insertPeg
	isEnded := func() bool {
		return p.report[rSequence] == p.command[sequence] && p.report[rResult] != 0 ||
			p.report[rAnswered] == p.command[sequence] && p.report[rRefusal] != 0
	}
	p.cycle()
	for n := 0; n < mostCycles && !isEnded(); n++ {
		p.cycle()
	}
	isDone := p.report[rSequence] == p.command[sequence] && p.report[rResult] == success
	p.command[acknowledge] = p.command[sequence]
	for n := 0; n < mostCycles && p.report[rResult] != 0; n++ {
		p.cycle()
	}
	return isDone && p.report[rResult] == 0
}

func main() {
	settings := &modbus.ClientConfiguration{URL: os.Args[1], Speed: 115200, Timeout: 10 * time.Second}
	if len(os.Args) == 6 {
		pair, err := tls.LoadX509KeyPair(os.Args[3], os.Args[4])
		must("certificate", err)
		settings.TLSClientCert = &pair
		settings.TLSRootCAs, err = modbus.LoadCertPool(os.Args[5])
		must("authority", err)
	}
	client, err := modbus.NewClient(settings)
	must("client", err)
	must("connect", client.Open())
	defer client.Close()
	client.SetUnitId(1)
	count, err := strconv.Atoi(os.Args[2])
	must("COUNT", err)

	p := &plc{line: client}
	p.read()
	p.command[sequence], p.command[version] = p.report[rSequence], p.report[rVersion]
	p.cycle()
	done := 0
	for n := 0; n < count; n++ {
		if p.run() {
			done++
		}
	}
	_, err = client.ReadRegister(commandWords, modbus.HOLDING_REGISTER)
	if !errors.Is(err, modbus.ErrIllegalDataAddress) {
		fmt.Printf("FC3 beyond the block: %v\n", err)
		os.Exit(1)
	}
	if client.WriteRegister(commandWords, 1) != modbus.ErrIllegalDataAddress {
		fmt.Println("FC6 beyond the block is taken")
		os.Exit(1)
	}
	fmt.Printf("triggered %d done %d\n", count, done)
}
